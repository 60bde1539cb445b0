"""Calibration errors."""

from station.errors import BadInputError, StationError
from station.messages.calibration import REFUSED
from station.messages.message import Message


class CalibrationError(StationError):
    """A calibration cannot be made, stored or found; the message gives the reason and the remedy."""


class RefusedError(CalibrationError):
    """The result is no valid calibration, for reasons each with its remedy; the one before stays in force."""

    def __init__(self, *reasons: Message) -> None:
        super().__init__(REFUSED(reasons=reasons))
        self.reasons = reasons


class UnknownCalibrationError(BadInputError):
    """There is no calibration of that name or unit."""
