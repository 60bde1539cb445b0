"""Diagnosis of an arm that cannot move: from the controller's state to the cause."""

from station.devices.arm.dashboard import DashboardFacts
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import Snapshot
from station.messages import arm as messages
from station.messages.message import VERBATIM, Message

RUNNING = 7
"""RTDE `robot_mode`: powered, brakes released."""
PLAYING = 2
STOPPED = frozenset({0, 1})
"""RTDE `runtime_state`: 0 is stopping, 1 stopped. A program in any other one, as paused, may still move the arm."""

SAFETY_CAUSES: tuple[tuple[int, ArmCause, Message], ...] = (
    (1 << 5 | 1 << 6 | 1 << 7, ArmCause.EMERGENCY_STOP, messages.EMERGENCY_STOP()),
    (1 << 8 | 1 << 9, ArmCause.SAFETY_FAULT, messages.SAFETY_FAULT()),
    (1 << 2, ArmCause.PROTECTIVE_STOP, messages.PROTECTIVE_STOP()),
    (1 << 4, ArmCause.SAFEGUARD_STOP, messages.SAFEGUARD_STOP()),
    (1 << 3 | 1 << 10, ArmCause.SAFEGUARD_STOP, messages.STOPPED_FOR_SAFETY()),
)
"""Bits of RTDE `safety_status_bits` (RTDE guide), the gravest first. The last row is the recovery mode, and stops that
have no bit of their own, as by a three-position enabling device."""

STATE_CAUSES = {ArmCause.NOT_POWERED, *(cause for _, cause, _ in SAFETY_CAUSES)}
"""Causes whose start and end the state alone shows."""


def from_state(snapshot: Snapshot) -> ArmFault | None:
    """Return the cause that the state alone shows; None if power and safety let the arm move."""
    for bits, cause, detail in SAFETY_CAUSES:
        if snapshot.safety_bits & bits:
            return ArmFault(cause, detail)
    if snapshot.robot_mode != RUNNING:
        return ArmFault(ArmCause.NOT_POWERED, messages.NOT_POWERED())
    return None


def diagnose(snapshot: Snapshot, facts: DashboardFacts, output: Message | None, *, was_healthy: bool) -> ArmFault:
    """Return the cause why a command was not done or no program plays.

    Args:
        facts: of its dashboard server.
        output: of the failed command; None if it gave none.
        was_healthy: the station's health lease was renewed without a gap.
    """
    fault = from_state(snapshot)
    if fault is not None:
        return fault
    if not facts.remote:
        return ArmFault(ArmCause.LOCAL_CONTROL, messages.LOCAL_CONTROL())
    if snapshot.runtime_state == PLAYING:
        not_taken = messages.COMMAND_NOT_TAKEN_BECAUSE(reason=output) if output else messages.COMMAND_NOT_TAKEN()
        return ArmFault(ArmCause.DEADLINE, not_taken)
    if not was_healthy:
        return ArmFault(ArmCause.WATCHDOG, messages.WATCHDOG())
    stopped = messages.PROGRAM_STOPPED_BECAUSE(reason=output) if output else messages.PROGRAM_STOPPED()
    return ArmFault(ArmCause.PROGRAM_STOPPED, stopped)


def from_output(output: Message | None) -> ArmFault | None:
    """Return the cause in ur-rtde's own exceptions; None if they leave it open."""
    if output is None or output.id != VERBATIM.id:
        return None
    lowered = str(output).lower()
    if "remote control" in lowered:
        return ArmFault(ArmCause.LOCAL_CONTROL, messages.LOCAL_CONTROL())
    if "already in use" in lowered:
        return ArmFault(ArmCause.REGISTERS_IN_USE, messages.REGISTERS_IN_USE())
    if any(words in lowered for words in ("could not connect", "timeout connecting", "end of file")):
        return ArmFault(ArmCause.LINK_LOST, messages.CONNECTION_FAILED(reason=output))
    return None
