"""A gauge study on the twin: the same fruit laid in, gripped and judged again and again, as the station does it.

An operator is what differs when somebody else sets the cell up on another day: another sensor unit, another zero of the
gripper, another habit of laying fruit in, and each fruit laid in anew. A repeat grips the same fruit where it lies.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from station.inspection.judge import early_stop, judge
from station.inspection.press import Flag, Measured, Press, usual_uncertainty_mm2
from station.settings.gripper import GripperCalibration
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.studies.cohort import member
from station.studies.gauge_table import Measurement
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import Fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Contact, Image
from station.vision.methods import make_method
from station.vision.step import measure_step

_ZERO_SD_MM = 0.2
_HABIT_PX, _HABIT_DEG = 10.0, 3.0
_PLACE_PX, _TURN_DEG, _TILT_DEG = 19.0, 5.0, 2.0
"""Standard deviations of an operator's gripper zero and habit, and of laying a fruit in; our estimates."""
_FRAME_S, _STEP_S = 1 / 30, 0.5
_APPROACH_MM = 2.0
_MOST_COUNTS = 40
_TOLERANCE_FRUIT = 30
_HELD_S = 2.0


class GaugeTask(NamedTuple):
    """One measurement to be made."""

    fruit: str
    seed: int
    part: int
    operator: int
    repeat: int


@dataclass(frozen=True, slots=True)
class Setup:
    """What one operator brings."""

    unit: int | None
    """Seed of the sensor's light; None for the unit that the optics were fitted on."""
    zero_mm: float
    """By how much every width is read too large."""
    habit: Pose


def part_of(task: GaugeTask) -> Fruit:
    """The fruit: every second one is bruised.

    Args:
        task: whose part.
    """
    return replace(member(task.fruit, task.seed, task.part).fruit, bruised=task.part % 2 == 1)


def setup_of(task: GaugeTask) -> Setup:
    """What the operator brings; the first has the fitted unit.

    Args:
        task: whose operator.
    """
    generator = np.random.default_rng([task.seed, 101, task.operator])
    x_px, y_px = generator.normal(0.0, _HABIT_PX, 2)
    turn_deg = float(generator.normal(0.0, _HABIT_DEG))
    zero_mm = float(generator.normal(0.0, _ZERO_SD_MM))
    unit = int(generator.integers(2**31)) if task.operator else None
    return Setup(unit, zero_mm, Pose(240.0 + x_px, 320.0 + y_px, turn_deg))


def pose_of(task: GaugeTask) -> Pose:
    """How the operator laid the part in.

    Args:
        task: whose part and operator.
    """
    habit = setup_of(task).habit
    generator = np.random.default_rng([task.seed, 102, task.part, task.operator])
    return Pose(
        habit.x_px + generator.normal(0.0, _PLACE_PX),
        habit.y_px + generator.normal(0.0, _PLACE_PX),
        habit.turn_deg + generator.normal(0.0, _TURN_DEG),
        generator.normal(0.0, _TILT_DEG),
    )


def true_area_mm2(task: GaugeTask) -> float:
    """The true area of a part as the operator laid it in, at the deciding closing: what a perfect gauge would say.

    Args:
        task: which part and operator.
    """
    return _true_area_mm2(part_of(task), pose_of(task), deciding_closing_mm(find_recipe(task.fruit)))


def _true_area_mm2(fruit: Fruit, pose: Pose, closing_mm: float) -> float:
    gel = Gel()
    return FruitOnGel(fruit, pose, gel).pressed(Squeeze(fruit, gel, _HELD_S).at(closing_mm)).true_area_mm2


def measure_part(task: GaugeTask) -> Measurement:
    """Grip a part once, by its recipe, and judge it.

    The gripper closes count by count to the first contact, then by the recipe's steps until the judge stops it: that
    press has the outcome. Where it ended before one step beyond the last damage threshold it goes on to there, so that
    the area at that threshold, which is the judge's own, is known; one that was never seen is 0 mm².

    Args:
        task: which part, who and how often.
    """
    cv2.setNumThreads(1)
    recipe = find_recipe(task.fruit)
    fruit, setup = part_of(task), setup_of(task)
    generator = np.random.default_rng([task.seed, 103, task.part, task.operator, task.repeat])
    grip = _Grip(recipe, fruit, pose_of(task), setup, int(generator.integers(2**31)))
    pressed = grip.press(float(generator.uniform(0.0, 1.0)))
    deciding_mm = deciding_closing_mm(recipe)
    areas = judge(pressed.on_to_the_threshold, recipe).areas
    area_mm2 = next(area.area_mm2 for area in areas if area.closing_mm == deciding_mm)
    return Measurement(
        f"{task.part + 1}",
        "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[task.operator],
        f"{task.repeat + 1}",
        area_mm2 or 0.0,
        judge(pressed.as_stopped, recipe).outcome,
        "FAIL" if fruit.bruised else "PASS",
    )


def deciding_closing_mm(recipe: Recipe) -> float:
    """The closing of the last damage threshold.

    Args:
        recipe: the fruit's.
    """
    return recipe.damage.area[-1].closing_mm


def good_and_damaged_mm2(fruit: str, seed: int) -> tuple[float, float]:
    """True areas at the deciding closing, mean over the paper's 30 sizes: of sound fruit, and of the same ones bruised.

    Their difference is the tolerance.

    Args:
        fruit: the recipe's name.
        seed: of the cohort.
    """
    closing_mm = deciding_closing_mm(find_recipe(fruit))

    def mean(*, bruised: bool) -> float:
        members = [member(fruit, seed, number) for number in range(_TOLERANCE_FRUIT)]
        areas = [_true_area_mm2(replace(one.fruit, bruised=bruised), one.pose, closing_mm) for one in members]
        return float(np.mean(areas))

    return mean(bruised=False), mean(bruised=True)


class _Pressed(NamedTuple):
    """One closing, as far as the station goes, and as far as its area at the last threshold needs."""

    as_stopped: Press
    on_to_the_threshold: Press


class _Grip:
    """One fruit between gel and sponge, seen and measured as the station does."""

    def __init__(self, recipe: Recipe, fruit: Fruit, pose: Pose, setup: Setup, noise_seed: int) -> None:
        self._recipe, self._fruit, self._zero_mm = recipe, fruit, setup.zero_mm
        self._count_mm = GripperCalibration().mm_per_count
        self._sensor = DigitSensor(noise_seed, setup.unit)
        self._gel = Gel()
        self._contact = FruitOnGel(fruit, pose, self._gel)
        self._now_s = 0.0
        self._touched_s: float | None = None
        references = self._frames(None, recipe.imaging.reference_frames)
        self._method = make_method(references, recipe.segmentation)

    def press(self, phase: float) -> _Pressed:
        """Close to the onset, then step by step.

        Args:
            phase: 0 to 1, where the fruit's width lies between two counts of the gripper.
        """
        start_mm = self._fruit.width_mm + _APPROACH_MM + phase * self._count_mm
        widths = [start_mm - count * self._count_mm for count in range(_MOST_COUNTS)]
        onset, contact = next(
            ((at, seen) for at, width in enumerate(widths) if (seen := self._touched(width)) is not None), (None, None)
        )
        if onset is None or contact is None:
            untouched = Press(None, 0.0, ())
            return _Pressed(untouched, untouched)
        steps, enough_mm = self._recipe.steps, deciding_closing_mm(self._recipe) + self._recipe.steps.step_mm
        press = Press(widths[onset] + self._zero_mm, self._count_mm if onset else 0.0, (self._point(0.0, contact),))
        stopped: Press | None = None
        for step in range(1, steps.number + 1):
            closing_mm = round(step * steps.step_mm / self._count_mm) * self._count_mm
            if stopped is None and early_stop(press, self._recipe) is not None:
                stopped = press
            if stopped is not None and press.points[-1].closing_mm > enough_mm - self._count_mm:
                break
            point = self._point(closing_mm, self._measured(widths[onset] - closing_mm))
            press = replace(press, points=(*press.points, point))
        return _Pressed(stopped or press, press)

    def _touched(self, width_mm: float) -> Contact | None:
        """One frame; where it shows a contact, a full step at the same width has to confirm it."""
        self._now_s += _FRAME_S
        if not self._method.measure(self._frames(width_mm, 1)[0]).found:
            return None
        contact = self._measured(width_mm)
        return contact if contact.found else None

    def _measured(self, width_mm: float) -> Contact:
        self._now_s += _STEP_S
        frames = self._frames(width_mm, self._recipe.imaging.frames_per_step)
        return measure_step(self._method, frames, self._recipe.segmentation.robust.least_confidence)

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
            area_uncertainty_mm2=usual_uncertainty_mm2(area_mm2),
            confidence=contact.confidence,
            flags=frozenset(Flag(flag.value) for flag in contact.flags),
        )
