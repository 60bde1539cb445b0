"""Calibration procedure of one unit: the paper's ball, 46 to 33 mm, then at further places.

Limits of the method (decision 22): the area over closing depends on how gel, ball and sponge share the closing, so
it gives no scale. A scale needs a known length on the gel: the distance from one place of the ball to another.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import combinations
from math import hypot
from typing import NamedTuple

from station.calibration import figures, gel
from station.calibration.checks import ROUNDEST, calibration_checks, failed_check
from station.calibration.errors import RefusedError
from station.calibration.figures import MeasuredScale
from station.calibration.model import Calibration, Check, Noise, PlacePoint, stamp
from station.calibration.press import BallPress, Step
from station.calibration.rig import BallRig, OnProgress, Place, Progress, Unit
from station.errors import BadInputError
from station.messages import calibration as messages
from station.messages.message import Definition, Message
from station.settings.calibration import CalibrationSettings
from station.settings.recipe_model import Recipe
from station.vision.contact import Image
from station.vision.image_quality import light, sharpness
from station.vision.scale import Scale

NOISE_FRAMES = 30
"""Frames of the untouched gel, of which noise and reference are made. An estimate."""
_GATE_FRAMES = 6
"""About so many of them, evenly spaced, are measured for the gate's noise. An estimate."""
_ROOM_MM = 4.0
"""Width of the fingers at the start beyond ball and holder, where the recipe gives no width: the paper begins at 46 mm
and meets the ball at 42 mm."""
_PLACES_CLOSING_MM = 2.0
"""Deep enough for a good centre, shallow enough to stay inside the field also away from the middle."""
_LEAST_WAY_MM = 2.0
"""Distance of two places of the ball, below which they give no scale. An estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A good calibration that is not stored yet, with its pictures."""

    calibration: Calibration
    reference: Image
    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Measurements of a calibration, complete or not."""

    reference: Image | None
    steps: tuple[Step, ...]
    """Every press, also those at further places."""
    checks: tuple[Check, ...]


class _Measured(NamedTuple):
    """Values that the result is judged by."""

    reference: Image
    frames: Sequence[Image]
    """With nothing touching the gel."""
    steps: Sequence[Step]
    onset_mm: float
    noise: Noise
    places: Sequence[PlacePoint]


class CalibrationProcedure:
    """One run, with further places of the ball. It stores nothing; when it is cancelled the jaws open."""

    def __init__(
        self,
        rig: BallRig,
        unit: Unit,
        recipe: Recipe,
        settings: CalibrationSettings,
        places: Sequence[Place],
        operator: str,
        program: str,
        on_progress: OnProgress,
    ) -> None:
        self._rig, self._unit, self._recipe, self._settings = rig, unit, recipe, settings
        self._places = [Place(0.0, 0.0), *places]
        self._operator, self._program, self._on_progress = operator, program, on_progress
        self._press = BallPress(rig, recipe)
        self._pressed: list[Step] = []
        self._checks: tuple[Check, ...] = ()
        # In the constructor, so that such places are refused before anything moves.
        if any(hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) < _LEAST_WAY_MM for a, b in combinations(self._places, 2)):
            raise BadInputError(messages.PLACES_TOO_NEAR(least_mm=_LEAST_WAY_MM))

    @property
    def evidence(self) -> Evidence:
        """Return the measurements until now."""
        return Evidence(self._press.reference, tuple(self._pressed), self._checks)

    async def run(self) -> Draft:
        """Calibrate once. The gripper presses the ball repeatedly, and releases it before the result is judged.

        Raises:
            RefusedError: the result is no valid calibration, with every reason.
            StationError: a device's fault; by then the jaws were commanded to open.
        """
        try:
            measured = await self._measure()
            await self._rig.release()
        # CancelledError is no Exception: a cancelled run opens the jaws, too.
        except BaseException:
            await self._press.let_go()
            raise
        self._say(messages.STEP_JUDGE, 1, 1)
        # In a thread: the event loop renews the arm's lease meanwhile, without which the controller stops the arm.
        return await asyncio.to_thread(self._judge, measured)

    async def _measure(self) -> _Measured:
        self._say(messages.STEP_UNTOUCHED, 1, 1, messages.FRAMES(number=NOISE_FRAMES))
        taken = await self._press.take_reference(NOISE_FRAMES)
        frames = taken.images
        reference = self._press.reference
        assert reference is not None  # noqa: S101 (taken just now)
        findings = await asyncio.to_thread(gel.examine, reference, None, self._settings.least_light)
        if findings:
            raise RefusedError(
                *(messages.FAULT_AND_REMEDY(fault=each.message, remedy=gel.REMEDIES[each.fault]()) for each in findings)
            )
        if max(await asyncio.to_thread(lambda: figures.pixel_noise(frames).mean(axis=(0, 1)))) == 0:
            raise RefusedError(messages.FRAMES_EQUAL())
        some = taken.frames[:: max(1, len(frames) // _GATE_FRAMES)]
        # Each by itself: the mean of all frames would hide the noise that the few frames of a step have.
        untouched = [(await self._press.measure(replace(taken, frames=(frame,)))).contact for frame in some]
        steps = await self._press_through()
        # There is one, and a step before it: `_press_through` refuses a press that has no contact or starts with one.
        first = next(step for step in steps if step.contact.is_firm)
        before = [step for step in steps if step.width_mm > first.width_mm]
        between = messages.ONSET_BETWEEN(wider_mm=before[-1].width_mm, narrower_mm=first.width_mm)
        self._say(messages.STEP_ONSET, 1, 1, between)
        onset_mm = await self._press.fine_onset(before[-1].width_mm, first.width_mm)
        # With the steps before the contact: the frames hardly show the light's drift, as the reference is their median.
        noise = await asyncio.to_thread(figures.noise, frames, [*untouched, *(step.contact for step in before)])
        return _Measured(reference, frames, steps, onset_mm, noise, await self._at_places(onset_mm))

    async def _press_through(self) -> list[Step]:
        plan = self._recipe.steps
        start_mm = plan.start_width_mm or self._settings.ball_mm + self._settings.holder_mm + _ROOM_MM
        steps: list[Step] = []
        for number in range(plan.number + 1):
            step = await self._press.step(start_mm - number * plan.step_mm)
            steps.append(step)
            self._pressed.append(step)
            self._say(messages.STEP_PRESS, number + 1, plan.number + 1, step.message)
            # Refused before the next step, so that what touches already is not pressed further.
            if number == 0 and step.contact.is_firm:
                met_mm = self._settings.ball_mm + self._settings.holder_mm
                raise RefusedError(
                    messages.TOUCHED_AT_START(width_mm=step.width_mm, ball_mm=self._settings.ball_mm, met_mm=met_mm)
                )
        if not any(step.contact.is_firm for step in steps):
            raise RefusedError(messages.NOTHING_TOUCHED(width_mm=steps[-1].width_mm))
        return steps

    async def _at_places(self, onset_mm: float) -> list[PlacePoint]:
        if len(self._places) < 2:
            return []
        found: list[PlacePoint] = []
        for number, place in enumerate(self._places):
            # The first place has the ball and a reference already.
            if number:
                await self._rig.release()
                await self._rig.lay(place)
                # The light drifts while a person moves the ball.
                await self._press.take_reference(self._recipe.imaging.reference_frames)
            step = await self._press.step(onset_mm - _PLACES_CLOSING_MM)
            self._pressed.append(step)
            contact = step.contact
            where = messages.PLACE(number=number + 1, x_mm=place.x_mm, y_mm=place.y_mm)
            # The centroid of a contact that is cut or not round is not the ball's middle: distances from it are wrong.
            if contact.centroid_px is None or step.point.cut or figures.roundness(contact) > ROUNDEST:
                raise RefusedError(messages.PLACE_UNSEEN(place=where, width_mm=step.width_mm))
            x_px, y_px = contact.centroid_px
            found.append(
                PlacePoint(
                    x_mm=place.x_mm,
                    y_mm=place.y_mm,
                    width_mm=round(step.width_mm, 3),
                    centroid_x_px=round(x_px, 2),
                    centroid_y_px=round(y_px, 2),
                    area_px=contact.area_px,
                )
            )
            seen = messages.PLACE_SEEN(place=where, x_px=x_px, y_px=y_px)
            self._say(messages.STEP_PLACE, number + 1, len(self._places), seen)
        return found

    def _judge(self, measured: _Measured) -> Draft:
        reference, frames, steps, onset_mm, noise, places = measured
        scale: MeasuredScale | None = None
        if len(places) > 1:
            scale = figures.scale_of(places, self._settings.place_tolerance_mm)
        height, width = reference.shape[:2]
        usual = Scale.typical(height, width)
        made = datetime.now(UTC)
        # Stored before the refusal below: `evidence` shows the checks of a refused run, too.
        checks = self._checks = tuple(calibration_checks(self._settings, self._recipe, steps, onset_mm, noise, scale))
        calibration = Calibration(
            id=stamp(made),
            serial=self._unit.serial,
            unit=self._unit.name,
            operator=self._operator,
            simulated=self._unit.simulated,
            program=self._program,
            ball_mm=self._settings.ball_mm,
            holder_mm=self._settings.holder_mm,
            width_px=width,
            height_px=height,
            mm_per_px=round(usual.mm_per_px if scale is None else scale.mm_per_px, 6),
            scale_uncertainty=round(usual.uncertainty if scale is None else scale.uncertainty, 4),
            scale_measured=scale is not None,
            places=tuple(places),
            curve=tuple(step.point for step in steps),
            onset_mm=round(onset_mm, 3),
            zero_mm=round(onset_mm - self._settings.ball_mm - self._settings.holder_mm, 3),
            noise=noise,
            light_levels=light(reference),
            sharpness_levels=round(sharpness(reference), 3),
            field=figures.field_map(reference, frames),
            checks=checks,
        )
        if bad := [check for check in checks if not check.passed]:
            raise RefusedError(*(failed_check(one) for one in bad))
        return Draft(calibration, reference, tuple(steps))

    def _say(self, title: Definition, number: int, of: int, detail: Message | None = None) -> None:
        self._on_progress(Progress(number, of, title(), detail))
