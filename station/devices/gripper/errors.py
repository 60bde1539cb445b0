"""Gripper errors, each with a code, a cause and a remedy."""

from typing import NamedTuple

from station.errors import StationError
from station.messages import gripper as messages
from station.messages.message import Message


class GripperError(StationError):
    """The gripper cannot carry out a request."""

    code = "gripper"

    def __init__(self, cause: Message, remedy: Message) -> None:
        super().__init__(messages.FAULT(cause=cause, remedy=remedy))
        self.cause = cause
        self.remedy = remedy


class GripperRequestError(GripperError):
    """A request that no gripper of this kind can fulfil; nothing was sent."""

    code = "request"


class GripperUnreachableError(GripperError):
    """No connection could be made."""

    code = "unreachable"


class GripperLinkLostError(GripperError):
    """The connection broke. The gripper continues its last command."""

    code = "link_lost"


class GripperSilentError(GripperError):
    """Connected, but no answer came in time."""

    code = "silent"


class GripperProtocolError(GripperError):
    """An invalid answer to a request."""

    code = "protocol"


class GripperNoValuesError(GripperError):
    """The URCap answers, but has no values of the gripper, and the robot is not emergency stopped."""

    code = "no_values"

    def __init__(self) -> None:
        super().__init__(messages.NO_VALUES(), messages.REMEDY_NO_VALUES())


class GripperNotActiveError(GripperError):
    """A motion was requested of a gripper that is not activated."""

    code = "not_active"


class GripperStoppedError(GripperError):
    """`stop` ended the move."""

    code = "stopped"


class GripperTimeoutError(GripperError):
    """The gripper answers, but did not finish, or not in time."""

    code = "timeout"


class GripperEmergencyStopError(GripperError):
    """The robot that carries the gripper is emergency stopped."""

    code = "emergency_stop"

    def __init__(self) -> None:
        super().__init__(messages.EMERGENCY_STOP(), messages.REMEDY_EMERGENCY_STOP())


class FaultText(NamedTuple):
    """Name, cause and remedy of a gripper fault."""

    name: str
    cause: Message
    remedy: Message


FAULTS: dict[int, FaultText] = {
    0x5: FaultText("activate_first", messages.ACTIVATE_FIRST(), messages.REMEDY_ACTIVATE()),
    0x7: FaultText("activation_bit", messages.ACTIVATION_BIT(), messages.REMEDY_ACTIVATE()),
    0x8: FaultText("over_temperature", messages.OVER_TEMPERATURE(), messages.REMEDY_OVER_TEMPERATURE()),
    0x9: FaultText("no_communication", messages.NO_COMMUNICATION(), messages.REMEDY_NO_COMMUNICATION()),
    0xA: FaultText("under_voltage", messages.UNDER_VOLTAGE(), messages.REMEDY_UNDER_VOLTAGE()),
    0xB: FaultText("releasing", messages.RELEASING(), messages.REMEDY_RELEASING()),
    0xC: FaultText("internal_fault", messages.INTERNAL_FAULT(), messages.REMEDY_INTERNAL_FAULT()),
    0xD: FaultText("activation_fault", messages.ACTIVATION_FAULT(), messages.REMEDY_BLOCKED()),
    0xE: FaultText("overcurrent", messages.OVERCURRENT(), messages.REMEDY_BLOCKED()),
    0xF: FaultText("released", messages.RELEASED(), messages.REMEDY_RELEASED()),
}
"""gFLT. Source: Robotiq 2F-85 & 2F-140 instruction manual, fault status register."""

NEEDS_ACTIVATION = range(0xA, 0x10)
"""Codes that only a reset and an activation clear; the others clear by themselves."""


class GripperFaultError(GripperError):
    """The gripper reports a fault."""

    def __init__(self, fault_code: int) -> None:
        text = FAULTS.get(fault_code, FaultText("unknown", messages.UNKNOWN(), messages.REMEDY_UNKNOWN()))
        cause = messages.REPORTED(cause=text.cause, number=f"0x{fault_code:02X}", name=text.name)
        super().__init__(cause, text.remedy)
        self.fault_code = fault_code
        self.code = text.name


LINK_ERRORS = (
    GripperUnreachableError,
    GripperLinkLostError,
    GripperSilentError,
    GripperProtocolError,
    GripperNoValuesError,
)
"""Errors of the connection, which say nothing of the fingers."""
