"""Arm faults: causes and remedies."""

from enum import StrEnum

from station.errors import StationError
from station.messages import arm as messages
from station.messages.message import Message


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
    CLOSED = "closed"


REMEDIES: dict[ArmCause, Message] = {
    ArmCause.LINK_LOST: messages.REMEDY_LINK_LOST(),
    ArmCause.STALE: messages.REMEDY_STALE(),
    ArmCause.DEADLINE: messages.REMEDY_DEADLINE(),
    ArmCause.PROTECTIVE_STOP: messages.REMEDY_PROTECTIVE_STOP(),
    ArmCause.EMERGENCY_STOP: messages.REMEDY_EMERGENCY_STOP(),
    ArmCause.SAFEGUARD_STOP: messages.REMEDY_SAFEGUARD_STOP(),
    ArmCause.SAFETY_FAULT: messages.REMEDY_SAFETY_FAULT(),
    ArmCause.NOT_POWERED: messages.REMEDY_NOT_POWERED(),
    ArmCause.LOCAL_CONTROL: messages.REMEDY_LOCAL_CONTROL(),
    ArmCause.PROGRAM_STOPPED: messages.REMEDY_PROGRAM_STOPPED(),
    ArmCause.WATCHDOG: messages.REMEDY_WATCHDOG(),
    ArmCause.REGISTERS_IN_USE: messages.REMEDY_REGISTERS_IN_USE(),
    ArmCause.UNREACHABLE: messages.REMEDY_UNREACHABLE(),
    ArmCause.NOT_REACHED: messages.REMEDY_NOT_REACHED(),
    ArmCause.STOPPED: messages.REMEDY_STOPPED(),
    ArmCause.BUSY: messages.REMEDY_BUSY(),
    ArmCause.UNHEALTHY: messages.REMEDY_UNHEALTHY(),
    ArmCause.CLOSED: messages.REMEDY_CLOSED(),
}


class ArmFault(StationError):  # noqa: N818 (a fault in the field's sense)
    """Fault of the arm: its cause and its details; the message ends with the remedy."""

    def __init__(self, cause: ArmCause, detail: Message) -> None:
        self.cause = cause
        self.detail = detail
        super().__init__(messages.FAULT(cause=detail, remedy=self.remedy))

    @property
    def remedy(self) -> Message:
        """Return the remedy."""
        return REMEDIES[self.cause]
