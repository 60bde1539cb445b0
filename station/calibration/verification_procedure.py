"""Verification procedure at the shift's start: the same ball against the stored calibration, and the gel's health."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from station.calibration import figures, gel
from station.calibration.checks import verification_checks
from station.calibration.gel import REMEDIES, Finding, GelFault
from station.calibration.model import Calibration, Check, Verification, stamp
from station.calibration.press import BallPress, Step
from station.calibration.rig import BallRig, OnProgress, Progress
from station.calibration.store import press_name
from station.messages import calibration as messages
from station.settings.calibration import CalibrationSettings
from station.settings.recipe_model import Recipe
from station.vision.contact import Image

_NOISE_FRAMES = 9
"""Frames of the untouched gel, of which noise and reference are made. An estimate."""
_EVERY = 2
"""One of so many widths of the calibration is pressed."""
_SOUND = {
    GelFault.TEAR: messages.NO_TEAR,
    GelFault.DIRT: messages.NO_DIRT,
    GelFault.LED: messages.LEDS_BRIGHT,
    GelFault.FOG: messages.NO_FOG,
    GelFault.WEAR: messages.NOT_WORN,
}


@dataclass(frozen=True, slots=True, eq=False)
class VerificationResult:
    """A verification with its pictures."""

    verification: Verification
    reference: Image
    pictures: dict[str, Image]
    """By file name."""


class VerificationProcedure:
    """One run against the calibration's pictures, the presses in its curve's order; the jaws are open afterwards."""

    def __init__(
        self,
        rig: BallRig,
        recipe: Recipe,
        settings: CalibrationSettings,
        calibration: Calibration,
        golden: Image,
        presses: Sequence[Image],
        operator: str,
        on_progress: OnProgress,
    ) -> None:
        self._rig, self._recipe, self._settings = rig, recipe, settings
        self._calibration, self._golden, self._presses = calibration, golden, presses
        self._operator, self._on_progress = operator, on_progress
        self._press = BallPress(rig, recipe, calibration.noise.gate_factor)

    async def run(self) -> VerificationResult:
        """Verify once. The gripper closes on the ball.

        Raises:
            StationError: a device's fault; by then the jaws were commanded to open. A bad gel or ball raises nothing.
        """
        try:
            verified = await self._run()
            await self._rig.release()
        # CancelledError is no Exception: a cancelled run opens the jaws, too.
        except BaseException:
            await self._press.let_go()
            raise
        return verified

    async def _run(self) -> VerificationResult:
        self._on_progress(Progress(1, 1, messages.STEP_UNTOUCHED(), messages.FRAMES(number=_NOISE_FRAMES)))
        frames = (await self._press.take_reference(_NOISE_FRAMES)).images
        reference = self._press.reference
        assert reference is not None  # noqa: S101 (taken just now)
        findings = await asyncio.to_thread(gel.examine, reference, self._golden, self._settings.least_light)
        pixel_levels = (await asyncio.to_thread(figures.pixel_noise, frames)).mean(axis=(0, 1))
        steps, onset_mm = await self._press_ball()
        curve = tuple(step.point for step in steps)
        blue, green, red = (float(level) for level in pixel_levels)
        checks = verification_checks(self._settings, self._calibration, curve, onset_mm, (blue, green, red))
        # Without its light, or through fog, the ball changes the image less on a sound gel, too.
        if not any(finding.fault in {GelFault.LED, GelFault.FOG} for finding in findings):
            findings += self._worn(steps)
        pictures = {f"{finding.fault}.png": finding.picture for finding in findings}
        checks += [self._health(fault, findings) for fault in GelFault]
        pictures |= {press_name(number): outlined(step) for number, step in enumerate(steps)}
        verification = Verification(
            id=stamp(datetime.now(UTC)),
            serial=self._calibration.serial,
            calibration=self._calibration.id,
            operator=self._operator,
            passed=all(check.passed for check in checks),
            area_ratio=figures.ratio(curve, self._calibration.curve, "area_px"),
            onset_mm=None if onset_mm is None else round(onset_mm, 3),
            checks=tuple(checks),
            curve=curve,
        )
        return VerificationResult(verification, reference, pictures)

    async def _press_ball(self) -> tuple[list[Step], float | None]:
        """Measure without contact, at every second width that showed a whole contact, and the onset."""
        reach_mm = self._recipe.steps.result_closings_mm[-1]
        whole = figures.judged(self._calibration.curve, self._calibration.onset_mm, reach_mm)
        widths = [self._calibration.curve[0].width_mm, *(point.width_mm for point in whole[::_EVERY])]
        steps: list[Step] = []
        for number, width_mm in enumerate(widths, start=1):
            steps.append(await self._press.step(width_mm))
            self._on_progress(Progress(number, len(widths), messages.STEP_PRESS(), steps[-1].message))
        touched = next((step for step in steps if step.contact.is_firm), None)
        # A contact at the first width began at a wider one, from which there is no step to search.
        if touched is None or touched is steps[0]:
            return steps, None if touched is None else touched.width_mm
        before = max(step.width_mm for step in steps if step.width_mm > touched.width_mm)
        # No further out than twice the tolerance, since the search goes count by count.
        from_mm = min(before, self._calibration.onset_mm + 2 * self._settings.onset_tolerance_mm)
        self._on_progress(Progress(1, 1, messages.STEP_ONSET(), messages.ONSET_FROM(width_mm=from_mm)))
        return steps, await self._press.fine_onset(max(from_mm, touched.width_mm), touched.width_mm)

    def _worn(self, steps: list[Step]) -> list[Finding]:
        touched = [step for step in steps if step.contact.found]
        ratio = figures.ratio([step.point for step in touched], self._calibration.curve, "contrast_levels")
        if ratio is None or ratio >= self._settings.least_contrast:
            return []
        worn = messages.WORN(percent=100 * ratio)
        now = touched[len(touched) // 2]
        widths = [abs(point.width_mm - now.width_mm) for point in self._calibration.curve]
        return [Finding(GelFault.WEAR, worn, gel.side_by_side(self._presses[widths.index(min(widths))], now.image))]

    @staticmethod
    def _health(fault: GelFault, findings: list[Finding]) -> Check:
        found = next((finding for finding in findings if finding.fault is fault), None)
        return Check(
            name=fault,
            passed=found is None,
            found=_SOUND[fault]() if found is None else found.message,
            expected=messages.AS_BEFORE(),
            remedy=REMEDIES[fault](),
            picture=None if found is None else f"{fault}.png",
        )


def outlined(step: Step) -> Image:
    """Draw a contact's outline into its step's picture."""
    return gel.outlined(step.image, step.contact.mask)
