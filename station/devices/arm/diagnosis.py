"""Diagnosis of an arm that cannot move: from the controller's state to the cause."""

from station.devices.arm.dashboard import DashboardFacts
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import Snapshot

RUNNING = 7
"""RTDE `robot_mode`: powered, brakes released."""
PLAYING = 2
"""RTDE `runtime_state`."""

SAFETY_CAUSES: tuple[tuple[int, ArmCause, str], ...] = (
    (1 << 5 | 1 << 6 | 1 << 7, ArmCause.EMERGENCY_STOP, "an emergency stop is active"),
    (1 << 8 | 1 << 9, ArmCause.SAFETY_FAULT, "the safety system reports a violation or a fault"),
    (1 << 2, ArmCause.PROTECTIVE_STOP, "the arm is in a protective stop"),
    (1 << 4, ArmCause.SAFEGUARD_STOP, "a safeguard stop is active"),
)
"""Bits of RTDE `safety_status_bits` (RTDE guide), the gravest first."""

STATE_CAUSES = {ArmCause.NOT_POWERED, *(cause for _, cause, _ in SAFETY_CAUSES)}
"""Causes whose start and end the state alone shows."""


def from_state(snapshot: Snapshot) -> ArmFault | None:
    """Return the cause that the state alone shows; None if power and safety let the arm move."""
    for bits, cause, words in SAFETY_CAUSES:
        if snapshot.safety_bits & bits:
            return ArmFault(cause, words)
    if snapshot.robot_mode != RUNNING:
        return ArmFault(ArmCause.NOT_POWERED, "the arm is not powered, or its brakes are on")
    return None


def diagnose(snapshot: Snapshot, facts: DashboardFacts, output: str, *, was_healthy: bool) -> ArmFault:
    """Return the cause why a command was not done or no program plays.

    Args:
        snapshot: the controller's state.
        facts: of its dashboard server.
        output: ur-rtde's output, if any.
        was_healthy: the station's health lease was renewed without a gap.
    """
    fault = from_state(snapshot)
    if fault is not None:
        return fault
    if not facts.remote:
        return ArmFault(ArmCause.LOCAL_CONTROL, "the controller is in local control and takes no program")
    if snapshot.runtime_state == PLAYING:
        return ArmFault(ArmCause.DEADLINE, f"the control program plays and did not take the command {output}".rstrip())
    if not was_healthy:
        return ArmFault(ArmCause.WATCHDOG, "the controller's watchdog stopped the program: the station was not healthy")
    return ArmFault(ArmCause.PROGRAM_STOPPED, f"the control program was stopped on the controller {output}".rstrip())


def from_output(words: str) -> ArmFault | None:
    """Return the cause in ur-rtde's own exceptions; None if they leave it open."""
    lowered = words.lower()
    if "remote control" in lowered:
        return ArmFault(ArmCause.LOCAL_CONTROL, "the controller is in local control and takes no program")
    if "already in use" in lowered:
        return ArmFault(
            ArmCause.REGISTERS_IN_USE, "another client or a fieldbus holds the controller's input registers"
        )
    if "could not connect" in lowered or "timeout connecting" in lowered:
        return ArmFault(ArmCause.LINK_LOST, f"ur-rtde could not connect: {words}")
    return None
