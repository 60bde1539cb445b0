"""Acceptance checks of calibration and verification, each with its remedy."""

from collections.abc import Sequence
from itertools import dropwhile

from station.calibration import figures
from station.calibration.figures import QUIET_GATE, MeasuredScale
from station.calibration.model import Calibration, Check, Levels, Noise, PressPoint
from station.calibration.press import Step
from station.messages import calibration as messages
from station.messages.message import Message, verbatim
from station.settings.calibration import CalibrationSettings
from station.settings.recipe_model import Recipe
from station.vision.scale import TYPICAL_UNCERTAINTY

ROUNDEST = 1.15
"""Largest ratio of a ball contact's axes."""
_LEAST_STEPS = 5
"""Whole contacts that a calibration's curve needs. An estimate."""
LEAST_CONFIDENCE = 0.5
"""Confidence of an area from which it is no doubtful one. An estimate."""
_SCALES_MM = (0.022, 0.034)
"""Smallest and largest scale that is accepted, mm of the gel per pixel: on either side of what is published for single
DIGIT units, 0.0255 to 0.0291. Estimates."""
_MOST_GATE_FACTOR = 1.6
"""Largest factor by which a noisy unit's detection threshold may be raised. An estimate."""


def calibration_checks(
    settings: CalibrationSettings,
    recipe: Recipe,
    steps: Sequence[Step],
    onset_mm: float,
    noise: Noise,
    scale: MeasuredScale | None,
) -> list[Check]:
    """Check a calibration against its limits; `scale` is None if the ball was pressed at one place only."""
    plan = recipe.steps
    met_mm = settings.ball_mm + settings.holder_mm
    curve = figures.judged([step.point for step in steps], onset_mm, plan.result_closings_mm[-1])
    shown = {point.width_mm for point in curve}
    touched = [step for step in steps if step.point.width_mm in shown and step.contact.found]
    fall = figures.falls(curve)
    # Without a step to judge, this and the confidence are 0, which fails their checks.
    round_ = max((figures.roundness(step.contact) for step in touched), default=0.0)
    # A confidence that the method does not give counts as 0, as for the judge.
    confidence = min((point.confidence or 0.0 for point in curve), default=0.0)
    checks = [
        Check(
            name="ball",
            passed=abs(onset_mm - met_mm) <= settings.ball_tolerance_mm,
            found=messages.CONTACT_BEGINS(width_mm=onset_mm),
            expected=messages.WIDTH_EXPECTED(width_mm=met_mm, tolerance_mm=settings.ball_tolerance_mm),
            remedy=messages.DO_BALL(),
        ),
        Check(
            name="round",
            passed=0 < round_ <= ROUNDEST,
            found=messages.AXES_DIFFER(percent=100 * (round_ - 1)),
            expected=messages.AXES_EXPECTED(percent=100 * (ROUNDEST - 1)),
            remedy=messages.DO_ROUND(),
        ),
        Check(
            name="steps",
            passed=len(curve) >= _LEAST_STEPS,
            found=messages.STEPS_WHOLE(number=len(curve)),
            expected=messages.AT_LEAST(value=_LEAST_STEPS),
            remedy=messages.DO_STEPS(),
        ),
        Check(
            name="rising",
            passed=fall is None,
            found=messages.AREA_RISES() if fall is None else _fallen(*fall),
            expected=messages.RISE_EXPECTED(),
            remedy=messages.DO_RISING(),
        ),
        Check(
            name="confidence",
            passed=confidence >= LEAST_CONFIDENCE,
            found=messages.WORST_CONFIDENCE(value=confidence),
            expected=messages.AT_LEAST(value=LEAST_CONFIDENCE),
            remedy=messages.DO_CONFIDENCE(),
        ),
        Check(
            name="noise",
            passed=noise.gate_factor <= _MOST_GATE_FACTOR,
            found=messages.GATE_REACHED(value=noise.gate),
            # The factor's limit, converted to the statistic, which is what was found.
            expected=messages.AT_MOST(value=QUIET_GATE * _MOST_GATE_FACTOR),
            remedy=messages.DO_NOISE(),
        ),
    ]
    if scale is not None:
        low, high = _SCALES_MM
        checks.append(
            Check(
                name="scale",
                # A measured scale that is no surer than the typical one gains nothing.
                passed=low <= scale.mm_per_px <= high and scale.uncertainty < TYPICAL_UNCERTAINTY,
                found=messages.SCALE_FOUND(scale_mm=scale.mm_per_px, percent=100 * scale.uncertainty),
                expected=messages.SCALE_EXPECTED(least_mm=low, most_mm=high),
                remedy=messages.DO_SCALE(),
            )
        )
    return checks


def verification_checks(
    settings: CalibrationSettings,
    calibration: Calibration,
    curve: Sequence[PressPoint],
    onset_mm: float | None,
    pixel_levels: Levels,
) -> list[Check]:
    """Check a verification, its curve in order of closing; `onset_mm` is None if nothing was touched."""
    area = figures.ratio(curve, calibration.curve, "area_px")
    # The widths before the contact have no area, which is no fall; a contact that is lost again is one.
    fall = figures.falls(list(dropwhile(lambda point: not point.area_px, curve)))
    # A dark colour's noise may be stored as 0: it must not divide by 0.
    noise = max(now / max(was, 0.1) for now, was in zip(pixel_levels, calibration.noise.pixel_levels, strict=True))
    shift_mm = None if onset_mm is None else onset_mm - calibration.onset_mm
    return [
        Check(
            name="onset",
            passed=shift_mm is not None and abs(shift_mm) <= settings.onset_tolerance_mm,
            found=messages.NOTHING_TOUCHED_NOW() if onset_mm is None else messages.CONTACT_BEGINS(width_mm=onset_mm),
            expected=messages.ONSET_EXPECTED(width_mm=calibration.onset_mm, tolerance_mm=settings.onset_tolerance_mm),
            remedy=messages.DO_ONSET(),
        ),
        Check(
            name="area",
            passed=area is not None and abs(area - 1.0) <= settings.area_tolerance,
            found=messages.NO_AREA() if area is None else messages.AREA_RATIO(percent=100 * area),
            expected=messages.RATIO_EXPECTED(
                least_percent=100 * (1 - settings.area_tolerance), most_percent=100 * (1 + settings.area_tolerance)
            ),
            remedy=messages.DO_AREA(),
        ),
        Check(
            name="rising",
            # A curve without a contact does not fall either.
            passed=fall is None and area is not None,
            found=_fallen(*fall) if fall else messages.NO_AREA() if area is None else messages.AREA_RISES(),
            expected=messages.RISE_EXPECTED(),
            remedy=messages.DO_RISING(),
        ),
        Check(
            name="noise",
            passed=noise <= settings.most_noise,
            found=messages.NOISE_RATIO(ratio=noise),
            expected=messages.NOISE_EXPECTED(ratio=settings.most_noise),
            remedy=messages.DO_NOISE_NOW(),
        ),
    ]


def check_name(name: str) -> Message:
    """Return a check's name as a message; that of a check which this version does not have is shown as it is."""
    known = _NAMES.get(name)
    return verbatim(name) if known is None else known()


def failed_check(check: Check) -> Message:
    """Return what a failed check found, with the remedy."""
    return messages.CHECK_FAILED(
        check=check_name(check.name), found=check.found, expected=check.expected, remedy=check.remedy
    )


_NAMES = {
    "ball": messages.CHECK_BALL,
    "round": messages.CHECK_ROUND,
    "steps": messages.CHECK_STEPS,
    "rising": messages.CHECK_RISING,
    "confidence": messages.CHECK_CONFIDENCE,
    "noise": messages.CHECK_NOISE,
    "scale": messages.CHECK_SCALE,
    "onset": messages.CHECK_ONSET,
    "area": messages.CHECK_AREA,
    "tear": messages.CHECK_TEAR,
    "dirt": messages.CHECK_DIRT,
    "led": messages.CHECK_LED,
    "fog": messages.CHECK_FOG,
    "wear": messages.CHECK_WEAR,
}


def _fallen(one: PressPoint, other: PressPoint) -> Message:
    return messages.AREA_FALLS(
        wider_mm=one.width_mm, narrower_mm=other.width_mm, before_px=one.area_px, after_px=other.area_px
    )
