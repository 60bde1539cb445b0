"""Acceptance checks of calibration and verification, each with its remedy."""

from collections.abc import Sequence
from itertools import dropwhile

from station.calibration import figures
from station.calibration.figures import QUIET_GATE, MeasuredScale
from station.calibration.model import Calibration, Check, Levels, Noise, PressPoint
from station.calibration.press import Step
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import Recipe
from station.vision.scale import TYPICAL_UNCERTAINTY

ROUNDEST = 1.15
"""Largest ratio of a ball contact's axes."""
_LEAST_STEPS = 5
_LEAST_CONFIDENCE = 0.5
_SCALES_MM = (0.022, 0.034)
_MOST_GATE_FACTOR = 1.6


def calibration_checks(
    settings: CalibrationSettings,
    recipe: Recipe,
    steps: Sequence[Step],
    onset_mm: float,
    noise: Noise,
    scale: MeasuredScale | None,
) -> list[Check]:
    """Check a calibration against its limits.

    Args:
        settings: ball and limits.
        recipe: the ball's.
        steps: all of them, as measured.
        onset_mm: width of the contact onset.
        noise: of the untouched gel.
        scale: None if the ball was pressed at one place only.
    """
    plan = recipe.steps
    met_mm = settings.ball_mm + settings.holder_mm
    curve = figures.judged([step.point for step in steps], onset_mm, plan.result_closings_mm[-1])
    shown = {point.width_mm for point in curve}
    touched = [step for step in steps if step.point.width_mm in shown and step.contact.found]
    fall = figures.falls(curve)
    round_ = max((figures.roundness(step.contact) for step in touched), default=0.0)
    confidence = min((point.confidence or 0.0 for point in curve), default=0.0)
    another_ball = "another ball or holder, or the gripper's zero is off: look at the ball, then at "
    checks = [
        Check(
            name="ball",
            passed=abs(onset_mm - met_mm) <= settings.ball_tolerance_mm,
            found=f"contact begins at {onset_mm:.2f} mm",
            expected=f"{met_mm:.1f} ± {settings.ball_tolerance_mm:g} mm",
            remedy=another_ball + "gripper.calibration.finger_offset_mm",
        ),
        Check(
            name="round",
            passed=0 < round_ <= ROUNDEST,
            found=f"the contact's axes differ by {round_ - 1:.0%}",
            expected=f"a ball's, at most {ROUNDEST - 1:.0%}",
            remedy="lay the rubber ball in, upright between the fingers, and nothing else",
        ),
        Check(
            name="steps",
            passed=len(curve) >= _LEAST_STEPS,
            found=f"{len(curve)} steps show a whole contact",
            expected=f"at least {_LEAST_STEPS}",
            remedy="lay the rubber ball in the gel's middle, and nothing else",
        ),
        Check(
            name="rising",
            passed=fall is None,
            found="the area rises at every step" if fall is None else _fallen(*fall),
            expected="an area that rises step by step",
            remedy="clean gel and ball, see that the ball does not slip or roll, and try again",
        ),
        Check(
            name="confidence",
            passed=confidence >= _LEAST_CONFIDENCE,
            found=f"{confidence:.2f} at the worst step",
            expected=f"at least {_LEAST_CONFIDENCE:g}",
            remedy="clean gel and lens, keep outside light off, and try again",
        ),
        Check(
            name="noise",
            passed=noise.gate_factor <= _MOST_GATE_FACTOR,
            found=f"with nothing touching the gate reaches {noise.gate:.2f}",
            expected=f"at most {QUIET_GATE * _MOST_GATE_FACTOR:.2f}",
            remedy="keep outside light off, check the sensor's cable and light, and try again",
        ),
    ]
    if scale is not None:
        low, high = _SCALES_MM
        checks.append(
            Check(
                name="scale",
                passed=low <= scale.mm_per_px <= high and scale.uncertainty < TYPICAL_UNCERTAINTY,
                found=f"{scale.mm_per_px:.5f} mm/px ± {scale.uncertainty:.1%}",
                expected=f"{low:g} to {high:g} mm/px, known better than without a measurement",
                remedy="lay the ball at exactly the places that were asked for, and try again",
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
    """Check a verification against the calibration.

    Args:
        settings: the tolerances.
        calibration: the unit's.
        curve: the widths pressed now, in order of closing.
        onset_mm: width of the contact onset; None if nothing was touched.
        pixel_levels: noise of the untouched gel.
    """
    area = figures.area_ratio(curve, calibration.curve)
    fall = figures.falls(list(dropwhile(lambda point: not point.area_px, curve)))
    noise = max(now / max(was, 0.1) for now, was in zip(pixel_levels, calibration.noise.pixel_levels, strict=True))
    shift_mm = None if onset_mm is None else onset_mm - calibration.onset_mm
    look = "look at the ball and how it lies, and at the gel; if both are as they were, calibrate"
    return [
        Check(
            name="onset",
            passed=shift_mm is not None and abs(shift_mm) <= settings.onset_tolerance_mm,
            found="nothing was touched" if onset_mm is None else f"contact begins at {onset_mm:.2f} mm",
            expected=f"{calibration.onset_mm:.2f} ± {settings.onset_tolerance_mm:g} mm",
            remedy="is it the ball of the calibration, in its holder? Then the gripper's zero has moved: calibrate",
        ),
        Check(
            name="area",
            passed=area is not None and abs(area - 1.0) <= settings.area_tolerance,
            found="no area" if area is None else f"{area:.1%} of the calibration's area",
            expected=f"{1 - settings.area_tolerance:.0%} to {1 + settings.area_tolerance:.0%}",
            remedy=look,
        ),
        Check(
            name="rising",
            passed=fall is None and area is not None,
            found=_fallen(*fall) if fall else "the area rises at every step" if area is not None else "no area",
            expected="an area that rises step by step",
            remedy="clean gel and ball, see that the ball does not slip or roll, and try again",
        ),
        Check(
            name="noise",
            passed=noise <= settings.most_noise,
            found=f"{noise:.1f} times the noise of the calibration",
            expected=f"at most {settings.most_noise:g} times",
            remedy="keep outside light off, check the sensor's cable and light",
        ),
    ]


def _fallen(one: PressPoint, other: PressPoint) -> str:
    return f"from {one.width_mm:.1f} to {other.width_mm:.1f} mm the area goes from {one.area_px} to {other.area_px} px"
