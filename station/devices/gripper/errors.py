"""Gripper errors, each with a code, a cause and a remedy."""

from typing import NamedTuple

from station.errors import StationError


class GripperError(StationError):
    """The gripper cannot carry out a request."""

    code = "gripper"

    def __init__(self, cause: str, remedy: str) -> None:
        super().__init__(f"gripper: {cause}; {remedy}")
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


class GripperNotActiveError(GripperError):
    """A motion was requested of a gripper that is not activated."""

    code = "not_active"


class GripperStoppedError(GripperError):
    """`stop` ended the move."""

    code = "stopped"


class GripperTimeoutError(GripperError):
    """The gripper answers, but did not finish in time."""

    code = "timeout"


class GripperEmergencyStopError(GripperError):
    """The robot that carries the gripper is emergency stopped."""

    code = "emergency_stop"

    def __init__(self) -> None:
        super().__init__(
            "the robot is emergency stopped",
            "make the cell safe, release the button, bring the robot back to running, then activate the gripper",
        )


class FaultText(NamedTuple):
    """Cause and remedy of a gripper fault, as text."""

    name: str
    cause: str
    remedy: str


_REACTIVATE = "clear the fingers and activate the gripper again"

FAULTS: dict[int, FaultText] = {
    0x5: FaultText("activate_first", "it was asked to move before its activation was complete", "activate it first"),
    0x7: FaultText("activation_bit", "it was asked to move without being activated", "activate it first"),
    0x8: FaultText("over_temperature", "it is too hot", "let it cool down, look for a finger that is held or stiff"),
    0x9: FaultText("no_communication", "it heard nothing for a second", "check the RS-485 wiring and its terminator"),
    0xA: FaultText("under_voltage", "its supply is too low", f"check the 24 V supply and its cable, {_REACTIVATE}"),
    0xB: FaultText("releasing", "it is releasing on its own", f"wait until the fingers stand, {_REACTIVATE}"),
    0xC: FaultText("internal_fault", "its electronics report a fault", f"switch it off and on, {_REACTIVATE}"),
    0xD: FaultText("activation_fault", "its activation failed", f"look for what blocks the fingers, {_REACTIVATE}"),
    0xE: FaultText(
        "overcurrent", "its motor drew too much current", f"look for what blocks the fingers, {_REACTIVATE}"
    ),
    0xF: FaultText("released", "it has released on its own", _REACTIVATE),
}
"""gFLT. Source: Robotiq 2F-85 & 2F-140 instruction manual, fault status register."""

NEEDS_ACTIVATION = range(0xA, 0x10)
"""Codes that only a reset and an activation clear; the others clear by themselves."""


class GripperFaultError(GripperError):
    """The gripper reports a fault."""

    def __init__(self, fault_code: int) -> None:
        text = FAULTS.get(
            fault_code,
            FaultText("unknown", "it reports a fault that its manual does not list", "look at its LED and its manual"),
        )
        super().__init__(f"{text.cause} (fault 0x{fault_code:02X}, {text.name})", text.remedy)
        self.fault_code = fault_code
        self.code = text.name
