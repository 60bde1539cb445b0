"""Calibration errors."""

from station.errors import BadInputError, StationError


class CalibrationError(StationError):
    """A calibration cannot be made, stored or found; the message gives the reason and the remedy."""


class RefusedError(CalibrationError):
    """The result is no valid calibration; the one before stays in force.

    Args:
        reasons: in sentences, each with the remedy.
    """

    def __init__(self, *reasons: str) -> None:
        super().__init__(f"no calibration is stored: {'; '.join(reasons)}")
        self.reasons = reasons


class UnknownCalibrationError(BadInputError):
    """There is no calibration of that name or unit."""
