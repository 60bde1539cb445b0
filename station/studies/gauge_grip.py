"""One grip of the twin's as the station does it: what lies between gel and sponge, seen and measured frame by frame."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from station.inspection.judge import early_stop
from station.inspection.press import Measured, Press
from station.settings.gripper import GripperCalibration
from station.settings.recipe_model import Recipe
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import Fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Contact, Image
from station.vision.methods import make_method
from station.vision.press import PressTracker
from station.vision.step import measure_step

_FRAME_S, _STEP_S = 1 / 30, 0.5
_APPROACH_MM = 2.0
_MOST_COUNTS = 40
_HELD_S = 2.0


def deciding_closing_mm(recipe: Recipe) -> float:
    """The closing of the last damage threshold.

    Args:
        recipe: the fruit's.
    """
    return recipe.damage.area[-1].closing_mm


def true_area_mm2(fruit: Fruit, pose: Pose, closing_mm: float) -> float:
    """The true area at a true closing, held for a while: what a perfect gauge would say.

    Args:
        fruit: what is pressed.
        pose: how it lies.
        closing_mm: from the true first contact.
    """
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
    """How much sooner it may have begun."""
    contact: Contact


class Grip:
    """One fruit between gel and sponge.

    Args:
        recipe: how many frames, and how they are measured; how to step, in a press.
        fruit: what is gripped.
        pose: how it lies.
        unit: seed of the sensor's light; None for the unit that the optics were fitted on.
        noise_seed: of the sensor's noise and drift.
        mm_per_px: the unit's true scale.
    """

    def __init__(
        self,
        recipe: Recipe,
        fruit: Fruit,
        pose: Pose,
        unit: int | None,
        noise_seed: int,
        mm_per_px: float = MM_PER_PX,
    ) -> None:
        self._recipe, self._fruit = recipe, fruit
        self._count_mm = GripperCalibration().mm_per_count
        self._sensor = DigitSensor(noise_seed, unit, mm_per_px=mm_per_px)
        self._gel = Gel(mm_per_px=mm_per_px)
        self._contact = FruitOnGel(fruit, pose, self._gel)
        self._now_s = 0.0
        self._touched_s: float | None = None
        references = self._frames(None, recipe.imaging.reference_frames)
        self._method = make_method(references, recipe.segmentation)

    def held(self, closing_mm: float) -> Contact:
        """Measure one step by itself, at a width that something else than the gripper's counts decides.

        Args:
            closing_mm: the true one.
        """
        return self._measured_alone(self._fruit.width_mm - closing_mm)

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
        enough_mm = deciding_closing_mm(self._recipe) + self._recipe.steps.step_mm - self._count_mm
        press = Press(onset.width_mm + zero_mm, onset.uncertainty_mm, ())
        stopped: Press | None = None
        for closing_mm, contact in self.steps(onset):
            press = replace(press, points=(*press.points, self._point(closing_mm, contact)))
            if stopped is None and early_stop(press, self._recipe) is not None:
                stopped = press
            if stopped is not None and closing_mm > enough_mm:
                break
        return Pressed(stopped or press, press, self._fruit.width_mm - onset.width_mm)

    def approach(self, phase: float) -> Onset | None:
        """Close count by count to the first contact.

        Args:
            phase: 0 to 1, where the fruit's width lies between two counts of the gripper.

        Returns:
            The onset; None where nothing was touched.
        """
        start_mm = self._fruit.width_mm + _APPROACH_MM + phase * self._count_mm
        for count in range(_MOST_COUNTS):
            width_mm = start_mm - count * self._count_mm
            contact = self._touched(width_mm)
            if contact is not None:
                return Onset(width_mm, self._count_mm if count else 0.0, contact)
        return None

    def steps(self, onset: Onset) -> Iterator[tuple[float, Contact]]:
        """Close step by step by the recipe; each step is pressed and measured when it is asked for.

        Args:
            onset: where the steps begin.

        Yields:
            The closing, in whole counts of the gripper, and the contact; first those of the onset.
        """
        yield 0.0, onset.contact
        tracker = PressTracker(self._method, self._recipe.segmentation.robust.least_confidence, first=onset.contact)
        for step in range(1, self._recipe.steps.number + 1):
            closing_mm = round(step * self._recipe.steps.step_mm / self._count_mm) * self._count_mm
            yield closing_mm, tracker.measure_step(self._step_frames(onset.width_mm - closing_mm))

    def _touched(self, width_mm: float) -> Contact | None:
        """One frame; where it shows a contact, a full step at the same width has to confirm it."""
        self._now_s += _FRAME_S
        if not self._method.measure(self._frames(width_mm, 1)[0]).is_firm:
            return None
        contact = self._measured_alone(width_mm)
        return contact if contact.is_firm else None

    def _measured_alone(self, width_mm: float) -> Contact:
        frames = self._step_frames(width_mm)
        return measure_step(self._method, frames, self._recipe.segmentation.robust.least_confidence)

    def _step_frames(self, width_mm: float) -> Sequence[Image]:
        self._now_s += _STEP_S
        return self._frames(width_mm, self._recipe.imaging.frames_per_step)

    def _frames(self, width_mm: float | None, number: int) -> Sequence[Image]:
        """So many frames at a true width; None for nothing between the fingers."""
        closing_mm = -1.0 if width_mm is None else self._fruit.width_mm - width_mm
        dent = None
        if closing_mm > 0:
            self._touched_s = self._now_s if self._touched_s is None else self._touched_s
            squeezed = Squeeze(self._fruit, self._gel, self._now_s - self._touched_s).at(closing_mm)
            dent = self._contact.pressed(squeezed).dent
        frames = []
        for _ in range(number):
            self._now_s += _FRAME_S
            frames.append(self._sensor.frame(dent, self._now_s))
        return frames

    def _point(self, closing_mm: float, contact: Contact) -> Measured:
        area_mm2 = contact.area_px * MM_PER_PX**2
        return Measured(
            closing_mm=closing_mm,
            area_mm2=area_mm2,
            area_px=contact.area_px,
            confidence=contact.confidence,
            flags=contact.flags,
        )
