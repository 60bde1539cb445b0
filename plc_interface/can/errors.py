"""What can go wrong on the line's CAN, each in one sentence with its remedy."""

from station.errors import StationError


class LineIoError(StationError):
    """Something about the bus, its nodes or a shot."""


class InterfaceError(LineIoError):
    """The CAN interface cannot be opened, or failed."""


class BusOffError(InterfaceError):
    """The controller has left the bus after too many errors."""


class BringUpError(LineIoError):
    """A node is not there, is another one, or does not take its configuration."""


class NodeLostError(LineIoError):
    """A node that was operational is so no longer."""


class NotReadyError(LineIoError):
    """No shot can be ordered now."""


class ShotError(LineIoError):
    """A shot that was asked for did not happen, or nobody knows whether it did."""

    def __init__(self, sequence: int, what: str) -> None:
        super().__init__(f"shot {sequence}: {what}")
        self.sequence = sequence


class LateShotError(ShotError):
    """The count at which the flap had to open is past; nothing was fired."""


class ShotRefusedError(ShotError):
    """The order cannot be carried out; nothing was fired."""


class EchoMissingError(ShotError):
    """The gate did not confirm or report in time; whether it fired is unknown."""


class EchoWrongError(ShotError):
    """The gate reports something other than was ordered."""


class ShotLostError(ShotError):
    """The gate was lost while the shot was ordered; whether it fired is unknown."""
