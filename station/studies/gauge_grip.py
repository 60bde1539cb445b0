"""One press on the twin by the station's own procedure: images and measurement of what is between gel and sponge."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from station.inspection.press import Press
from station.messages.message import Message
from station.press.measurement import PressMeasurement, measured_point
from station.press.procedure import close_in_steps, onset_from, take_step
from station.press.reference import take_reference
from station.press.rig import MeasuredStep, Position, Step
from station.press.stop import NothingTouchedError, ends_steps
from station.settings.gripper import GripperCalibration
from station.settings.recipe_model import Recipe
from station.studies.simulated_rig import SimulatedFrame, StationaryRig
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import Fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Contact
from station.vision.median import median_image
from station.vision.methods import make_method

_FRAME_S, _STEP_S = 1 / 30, 0.5
"""Time of a frame at 30 a second, and of one width step. An estimate."""
_APPROACH_MM = 2.0
"""Distance from the fruit's true width at which the search for the first contact begins. An estimate."""
_MOST_COUNTS = 40
"""Counts of the gripper that are searched for the first contact. An estimate."""
_HELD_S = 2.0
"""Time for which a fruit has been held where its true area is computed, so that it has crept. An estimate."""
_OPEN_BY_MM = 20.0
"""Width of the open fingers beyond the fruit's. An estimate."""
CALIBRATION_SD = 0.011
"""Relative standard uncertainty of a calibrated scale: half the ± 2.2 %, two standard deviations, that `station
calibrate` states at three places (docs/calibration.md)."""

GoesOn = Callable[[float, Contact], bool]
"""Gets a step's closing, mm, and its contact; returns whether another step is to be made."""


def last_limit_mm(recipe: Recipe) -> float:
    """The closing of the recipe's last damage threshold."""
    return recipe.damage.area[-1].closing_mm


def true_area_mm2(fruit: Fruit, pose: Pose, closing_mm: float) -> float:
    """The true area at a closing from the true first contact, held for a while: what a perfect gauge would measure."""
    gel = Gel()
    return FruitOnGel(fruit, pose, gel).pressed(Squeeze(fruit, gel, _HELD_S).at(closing_mm)).true_area_mm2


class Pressed(NamedTuple):
    """One closing, as far as the station goes, and as far as its area at the last threshold needs."""

    as_stopped: Press
    on_to_the_threshold: Press
    late_mm: float | None
    """The true closing at which the first contact was seen; None where nothing was touched."""


class Onset(NamedTuple):
    """The first contact that the station sees."""

    width_mm: float
    """The true one."""
    uncertainty_mm: float
    """How much sooner it may have started."""
    contact: Contact


class FruitRig(StationaryRig):
    """A press rig with one fruit between gel and sponge. Its widths are the true ones.

    Args:
        pose: how it lies.
        unit: seed of the sensor's light; None for the unit that the optics were fitted on.
        noise_seed: of the sensor's noise and drift.
        mm_per_px: the unit's true scale.
    """

    def __init__(
        self, fruit: Fruit, pose: Pose, unit: int | None, noise_seed: int, mm_per_px: float = MM_PER_PX
    ) -> None:
        self.fruit = fruit
        self.finest_step_mm = GripperCalibration().mm_per_count
        self.widest_mm = self.counts_from_mm = fruit.width_mm + _OPEN_BY_MM
        """The fingers reach only widths that are whole counts of the gripper from `counts_from_mm`."""
        self._sensor = DigitSensor(noise_seed, unit, mm_per_px=mm_per_px)
        self._gel = Gel(mm_per_px=mm_per_px)
        self._contact = FruitOnGel(fruit, pose, self._gel)
        self._width_mm, self._now_s = self.widest_mm, 0.0
        self._touched_s: float | None = None

    async def open(self, width_mm: float | None = None) -> Position:
        """Open the fingers."""
        self._width_mm = self.widest_mm if width_mm is None else width_mm
        return Position(self._width_mm)

    async def close_to(self, width_mm: float) -> Position:
        """Move to the nearest count of the gripper."""
        counts = round((self.counts_from_mm - width_mm) / self.finest_step_mm)
        self._width_mm = self.counts_from_mm - counts * self.finest_step_mm
        self._now_s += _FRAME_S
        return Position(self._width_mm)

    async def settle(self) -> None:
        """Let the rest of a step's time pass."""
        self._now_s += _STEP_S - _FRAME_S

    async def frames(self, number: int) -> tuple[SimulatedFrame, ...]:
        """Image so often."""
        return self.images_at(self._width_mm, number)

    def images_at(self, width_mm: float, number: int) -> tuple[SimulatedFrame, ...]:
        """Take so many frames at any true width, also between two counts, without a pause before."""
        closing_mm = self.fruit.width_mm - width_mm
        dent = None
        if closing_mm > 0:
            self._touched_s = self._now_s if self._touched_s is None else self._touched_s
            squeezed = Squeeze(self.fruit, self._gel, self._now_s - self._touched_s).at(closing_mm)
            dent = self._contact.pressed(squeezed).dent
        frames: list[SimulatedFrame] = []
        for _ in range(number):
            self._now_s += _FRAME_S
            frames.append(SimulatedFrame(self._sensor.frame(dent, self._now_s), self._now_s))
        return tuple(frames)

    async def release(self, failed: Message | None = None) -> None:
        """Open the fingers."""
        await self.open()


class Grip:
    """One fruit between gel and sponge, stepped and measured by a recipe."""

    def __init__(self, recipe: Recipe, rig: FruitRig) -> None:
        self._recipe, self._rig = recipe, rig
        untouched = asyncio.run(take_reference(rig, recipe.imaging.reference_frames))
        self.method = make_method(median_image(untouched.images), recipe.segmentation)
        self._measurement = PressMeasurement(self.method)

    def held(self, closing_mm: float) -> Contact:
        """Measure one step by itself, at a true closing that something else than the gripper's counts decides."""
        # Counts from the stop's width on, so that `close_to` does not round it.
        width_mm = self._rig.counts_from_mm = self._rig.fruit.width_mm - closing_mm
        return self._measurement.measure(asyncio.run(take_step(self._rig, self._recipe, 0, width_mm))).contact

    def press(self, phase: float, zero_mm: float) -> Pressed:
        """Close to the onset, then step by step.

        Args:
            phase: 0 to 1, where the fruit's width lies between two counts of the gripper.
            zero_mm: by how much every width is read too large.
        """
        onset = self.approach(phase)
        if onset is None:
            untouched = Press(None, 0.0, ())
            return Pressed(untouched, untouched, None)
        enough_mm = last_limit_mm(self._recipe) + self._recipe.steps.step_mm - self._rig.finest_step_mm
        press = Press(
            onset.width_mm + zero_mm,
            onset.uncertainty_mm,
            (),
            resolution_mm=self._rig.finest_step_mm,
            scale_uncertainty=CALIBRATION_SD,
        )
        stopped: Press | None = None

        def goes_on(closing_mm: float, contact: Contact) -> bool:
            nonlocal press, stopped
            press = replace(press, points=(*press.points, measured_point(contact, closing_mm, MM_PER_PX)))
            if stopped is None and ends_steps(press, self._recipe):
                stopped = press
            return stopped is None or closing_mm <= enough_mm

        self.close(onset, goes_on)
        return Pressed(stopped or press, press, self._rig.fruit.width_mm - onset.width_mm)

    def approach(self, phase: float) -> Onset | None:
        """Close count by count to the first contact, None without one; `phase` as for `press`."""
        count_mm = self._rig.finest_step_mm
        start_mm = self._rig.counts_from_mm = self._rig.fruit.width_mm + _APPROACH_MM + phase * count_mm

        async def measure(step: Step) -> MeasuredStep:
            return self._measurement.seek(step)

        # Half a count of room: rounding adds no count and takes none away.
        lowest_mm = start_mm - (_MOST_COUNTS - 0.5) * count_mm
        try:
            found = asyncio.run(onset_from(self._rig, self._recipe, start_mm, lowest_mm, measure))
        except NothingTouchedError:
            return None
        width_mm = found.start.step.move.width_mm
        return Onset(width_mm, count_mm if width_mm < start_mm else 0.0, found.start.contact)

    def close(self, onset: Onset, goes_on: GoesOn) -> None:
        """Close step by step by the recipe as one press; `goes_on` gets closings in whole counts, the onset's first."""
        count_mm = self._rig.finest_step_mm
        self._rig.counts_from_mm = onset.width_mm
        self._measurement.follow(onset.contact)

        async def measured(step: Step) -> bool:
            counts = round((onset.width_mm - step.move.width_mm) / count_mm)
            return goes_on(counts * count_mm, self._measurement.measure(step).contact)

        if goes_on(0.0, onset.contact):
            asyncio.run(close_in_steps(self._rig, self._recipe, onset.width_mm, measured))
