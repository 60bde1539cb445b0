"""Errors of the line's CAN."""

from station.errors import StationError
from station.messages.can import SHOT
from station.messages.message import Message


class LineIoError(StationError):
    """Base of all errors of the bus, its nodes and reject actuations."""


class InterfaceError(LineIoError):
    """The CAN interface cannot be opened, or failed."""


class BusOffError(InterfaceError):
    """The controller has left the bus after too many errors."""


class BringUpError(LineIoError):
    """A node is not there, is another one, or does not take its configuration."""


class NodeLostError(LineIoError):
    """A node that was operational is lost."""


class NotReadyError(LineIoError):
    """No reject actuation can be ordered now."""


class RejectError(LineIoError):
    """A reject actuation that did not happen, or whose result is unknown."""

    def __init__(self, sequence: int, what: Message) -> None:
        super().__init__(SHOT(sequence=sequence, what=what))
        self.sequence = sequence


class LateRejectError(RejectError):
    """The count at which the flap had to open is past; the gate did not actuate."""


class RejectRefusedError(RejectError):
    """The order cannot be carried out; the gate did not actuate."""


class GateFullError(RejectRefusedError):
    """All places of the gate are taken; the order may be repeated."""


class EchoMissingError(RejectError):
    """The gate did not confirm or report in time; whether it actuated is unknown."""


class EchoWrongError(RejectError):
    """The gate reports something other than was ordered."""


class RejectLostError(RejectError):
    """The gate was lost with the order pending; whether it actuated is unknown."""
