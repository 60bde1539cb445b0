"""Arm faults: causes and remedies."""

from enum import StrEnum

from station.errors import StationError


class ArmCause(StrEnum):
    """Causes that the driver distinguishes."""

    LINK_LOST = "link_lost"
    STALE = "stale"
    DEADLINE = "deadline"
    PROTECTIVE_STOP = "protective_stop"
    EMERGENCY_STOP = "emergency_stop"
    SAFEGUARD_STOP = "safeguard_stop"
    SAFETY_FAULT = "safety_fault"
    NOT_POWERED = "not_powered"
    LOCAL_CONTROL = "local_control"
    PROGRAM_STOPPED = "program_stopped"
    WATCHDOG = "watchdog"
    REGISTERS_IN_USE = "registers_in_use"
    UNREACHABLE = "unreachable"
    NOT_REACHED = "not_reached"
    STOPPED = "stopped"
    BUSY = "busy"
    UNHEALTHY = "unhealthy"
    RESTARTS = "restarts"
    CLOSED = "closed"


REMEDIES: dict[ArmCause, str] = {
    ArmCause.LINK_LOST: "Check that the controller is on and its network cable is in; the driver keeps trying.",
    ArmCause.STALE: "Wait a moment; if it stays, check the network between the station and the controller.",
    ArmCause.DEADLINE: "Look at the arm and the pendant; the driver has let go and connects anew.",
    ArmCause.PROTECTIVE_STOP: "Find out why the arm stopped, clear its way, then confirm the protective stop.",
    ArmCause.EMERGENCY_STOP: "Make the cell safe, release the emergency stop button, then power on and release brakes.",
    ArmCause.SAFEGUARD_STOP: "Close the guard or clear the light curtain, then upload the program again.",
    ArmCause.SAFETY_FAULT: "Read the pendant's log and mend the cause, then power on and release brakes.",
    ArmCause.NOT_POWERED: "Make sure that nobody is at the arm, then power on and release brakes.",
    ArmCause.LOCAL_CONTROL: "Switch the pendant to remote control, then upload the program again.",
    ArmCause.PROGRAM_STOPPED: "Find out who stopped the program on the pendant and why, then upload it again.",
    ArmCause.WATCHDOG: "Mend what made the station unhealthy or slow, then upload the program again.",
    ArmCause.REGISTERS_IN_USE: "Close the other RTDE client, or disable EtherNet/IP, PROFINET and MODBUS on the "
    "controller: they claim registers 0 to 23; then upload the program again.",
    ArmCause.UNREACHABLE: "Teach the pose anew, or widen the controller's safety limits.",
    ArmCause.NOT_REACHED: "Look at the arm: something held it, or its encoders or its payload setting are wrong.",
    ArmCause.STOPPED: "Nothing: the station stopped the motion itself.",
    ArmCause.BUSY: "Wait for the motion that is under way, or stop it.",
    ArmCause.UNHEALTHY: "Mend what keeps the station from being healthy.",
    ArmCause.RESTARTS: "Look at the station's log for why the driver's process keeps ending, then upload again.",
    ArmCause.CLOSED: "Open the arm again.",
}


class ArmFault(StationError):  # noqa: N818 (a fault in the field's sense)
    """Fault of the arm: its cause and its details; the text ends with the remedy."""

    def __init__(self, cause: ArmCause, detail: str) -> None:
        self.cause = cause
        self.detail = detail
        super().__init__(f"arm: {detail}. {self.remedy}")

    @property
    def remedy(self) -> str:
        """Return the remedy."""
        return REMEDIES[self.cause]
