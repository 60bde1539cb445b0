"""Why no calibration or verification came of it."""

from station.errors import BadInputError, StationError


class CalibrationError(StationError):
    """It cannot be made, stored or found; the message says why and what to do."""


class RefusedError(CalibrationError):
    """What was measured is no calibration; the one before stands.

    Args:
        reasons: in sentences, each with what to do.
    """

    def __init__(self, *reasons: str) -> None:
        super().__init__(f"no calibration is stored: {'; '.join(reasons)}")
        self.reasons = reasons


class UnknownCalibrationError(BadInputError):
    """There is none of that name or unit."""
