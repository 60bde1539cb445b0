"""Active calibration of the sensor: scale, detection threshold, golden reference, age, and due verification."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from station.calibration.checks import check_name
from station.calibration.model import Calibration, GelChange, Verification
from station.calibration.store import CALIBRATIONS, REFERENCE, VERIFICATIONS, CalibrationStore
from station.messages import calibration as messages
from station.messages.message import Message
from station.settings.configuration import Configuration
from station.vision.scale import TYPICAL_STANDARD_UNCERTAINTY

_DAY_S, _HOUR_S = 86_400.0, 3_600.0


class CalibrationInUse(NamedTuple):
    """Scale that a fruit is measured by."""

    mm_per_px: float
    words: Message
    """For the fruit's record and the pages."""
    scale_uncertainty: float
    """Relative standard uncertainty of `mm_per_px`."""


class CalibrationFigures(NamedTuple):
    """Calibration figures for the metrics; None for a missing value."""

    age_s: float | None
    verification_age_s: float | None
    drift: float | None


class ActiveCalibration:
    """Newest calibration of the sensor in use; read again when another one is stored. The clock is in s since 1970."""

    def __init__(
        self, configuration: Configuration, serial: Callable[[], str], clock: Callable[[], float] = time.time
    ) -> None:
        self._store, self._home = CalibrationStore(configuration.home), configuration.home
        self._settings, self._usual_mm_per_px = configuration.calibration, configuration.camera.mm_per_px
        self._required = configuration.service.uncalibrated == "refuse"
        self._serial, self._clock = serial, clock
        self._seen: object = None
        self._calibration: Calibration | None = None
        self._verification: Verification | None = None
        self._gel_change: GelChange | None = None
        """Why there is no calibration in force, where that is so."""

    @property
    def calibration(self) -> Calibration | None:
        """Return the calibration in force; None if the sensor has none."""
        self._refresh()
        return self._calibration

    @property
    def in_force(self) -> CalibrationInUse:
        """Return the scale that areas are reported in, and its source."""
        calibration = self.calibration
        if calibration is None:
            none = messages.NONE if self._required else messages.NONE_ALLOWED
            words = none(scale_mm=self._usual_mm_per_px)
            return CalibrationInUse(self._usual_mm_per_px, words, TYPICAL_STANDARD_UNCERTAINTY)
        measured = calibration.scale_measured
        scale = calibration.mm_per_px if measured else self._usual_mm_per_px
        words = messages.IN_USE(summary=calibration.summary(), scale_mm=scale)
        return CalibrationInUse(
            scale, words, calibration.scale_uncertainty / 2 if measured else TYPICAL_STANDARD_UNCERTAINTY
        )

    @property
    def gate_factor(self) -> float:
        """Return the factor that raises the recipe's detection threshold on this unit."""
        return 1.0 if self.calibration is None else self.calibration.noise.gate_factor

    def golden(self) -> Path | None:
        """Return the file of the untouched gel as it was calibrated."""
        return None if self.calibration is None else self._store.folder(self.calibration) / REFERENCE

    @property
    def figures(self) -> CalibrationFigures:
        """Return ages and drift now."""
        calibration, verified = self.calibration, self._verification
        return CalibrationFigures(
            None if calibration is None else self._clock() - calibration.made_at.timestamp(),
            None if verified is None else self._clock() - verified.made_at.timestamp(),
            None if verified is None else verified.drift,
        )

    def refusal(self) -> Message | None:
        """Return why inspections are refused, with the remedy; None if all that is required was done."""
        limit_h, calibration = self._settings.verify_every_h, self.calibration
        if calibration is None and (self._required or limit_h is not None):
            return self._gel_change.words() if self._gel_change else messages.REQUIRED()
        if limit_h is None:
            return None
        verified, age_s = self._verification, self.figures.verification_age_s
        how = messages.HOW_TO_VERIFY()
        if verified is None or age_s is None:
            return messages.NEVER_VERIFIED(how=how)
        if not verified.passed:
            return messages.VERIFICATION_FAILED(how=how)
        if age_s > limit_h * _HOUR_S:
            return messages.VERIFICATION_OLD(age_h=age_s / _HOUR_S, limit_h=limit_h, how=how)
        return None

    def alarm_detail(self) -> Message | None:
        """Return the detail of the alarm calibration_old; None for no alarm."""
        calibration, verified = self.calibration, self._verification
        if calibration is None:
            needed = (self._required or self._settings.verify_every_h is not None) and self._serial()
            missing = self._gel_change.words() if self._gel_change else messages.MISSING()
            return missing if needed else None
        # Why triggers are refused comes first; the failed checks, which say more of a failed verification, come below.
        if (why := self.refusal()) and (verified is None or verified.passed):
            return why
        age_days = (self.figures.age_s or 0.0) / _DAY_S
        if age_days > self._settings.oldest_days:
            return messages.OLD(age_days=age_days, limit_days=self._settings.oldest_days)
        if verified is not None and not verified.passed:
            failed = [check_name(check.name) for check in verified.checks if not check.passed]
            return messages.CHECKS_FAILED(verification=verified.id, checks=failed)
        return None

    def _refresh(self) -> None:
        serial = self._serial()
        seen = (serial, *(_changed(self._home / kind / serial) for kind in (CALIBRATIONS, VERIFICATIONS)))
        if not serial or seen == self._seen:
            return
        self._calibration = self._store.current(serial)
        self._gel_change = self._store.gel_change(serial) if self._calibration is None else None
        self._verification = None if self._calibration is None else self._store.last_verification(self._calibration)
        self._seen = seen


def _changed(folder: Path) -> int:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0
