"""Gauge study with fruit: the same fruit laid in, gripped and judged repeatedly on the twin.

An operator represents all that differs when another person sets the cell up on another day: another sensor unit,
another zero of the gripper, another habit of laying fruit in, and each fruit laid in anew. A repeat grips the same
fruit in its place.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from station.inspection.judge import judge
from station.settings.recipe import find_recipe
from station.studies.cohort import PAPER_SAMPLES, PLACE_PX, TILT_DEG, TURN_DEG, member
from station.studies.gauge_grip import FruitRig, Grip, last_limit_mm, true_area_mm2
from station.studies.gauge_table import Measurement
from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.fruit import Fruit

_ZERO_SD_MM = 0.2
_HABIT_PX, _HABIT_DEG = 10.0, 3.0
"""Standard deviations of an operator's gripper zero and habit. Estimates."""

PART_TRUTHS = (
    "Fruit placed again: true areas at the true closing",
    "and the gripper's counts: true areas at the closing as the station counts it",
)
"""Causes of variation of a measured fruit's true areas, each together with all before it."""


class GaugeTask(NamedTuple):
    """One measurement to be made."""

    fruit: str
    seed: int
    part: int
    operator: int
    repeat: int

    @property
    def names(self) -> tuple[str, str, str]:
        """Return part, operator and repeat as in the table."""
        return f"{self.part + 1}", "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[self.operator], f"{self.repeat + 1}"


class Simulated(NamedTuple):
    """One measurement on the twin, with the truth."""

    measurement: Measurement
    truths_mm2: tuple[float, ...]
    """True areas, from the fewest causes of variation to all."""
    refused: int = 0
    """Number of flagged readings before this one."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Properties of one operator."""

    unit: int | None
    """Seed of the sensor's light; None for the unit that the optics were fitted on."""
    zero_mm: float
    """Error of every width reading; positive reads too large."""
    habit: Pose


def part_of(task: GaugeTask) -> Fruit:
    """Return the fruit: every second one is bruised."""
    return replace(member(task.fruit, task.seed, task.part).fruit, bruised=task.part % 2 == 1)


def setup_of(task: GaugeTask) -> Setup:
    """Return the operator's properties; the first has the fitted unit."""
    # 101 to 104 make the draws of operator, placing, grip and dummy independent of each other.
    generator = np.random.default_rng([task.seed, 101, task.operator])
    x_px, y_px = generator.normal(0.0, _HABIT_PX, 2)
    turn_deg = float(generator.normal(0.0, _HABIT_DEG))
    zero_mm = float(generator.normal(0.0, _ZERO_SD_MM))
    unit = int(generator.integers(2**31)) if task.operator else None
    return Setup(unit, zero_mm, Pose(MIDDLE_X_PX + x_px, MIDDLE_Y_PX + y_px, turn_deg))


def pose_of(task: GaugeTask) -> Pose:
    """Return the pose in which the operator laid the part."""
    habit = setup_of(task).habit
    generator = np.random.default_rng([task.seed, 102, task.part, task.operator])
    return Pose(
        habit.x_px + generator.normal(0.0, PLACE_PX),
        habit.y_px + generator.normal(0.0, PLACE_PX),
        habit.turn_deg + generator.normal(0.0, TURN_DEG),
        generator.normal(0.0, TILT_DEG),
    )


def measure_part(task: GaugeTask) -> Simulated:
    """Grip a part once, by its recipe, and judge it.

    The gripper closes count by count to the contact onset, then by the recipe's steps until the judge stops it: that
    press gives the outcome. If it ended before one step beyond the last damage threshold it continues to there, so that
    the area at that threshold, which is the judge's own, is known; without a contact it is 0 mm².

    Returns:
        The measurement with the truths of `PART_TRUTHS`.
    """
    # So that --jobs gives the number of cores used.
    cv2.setNumThreads(1)
    recipe = find_recipe(task.fruit)
    fruit, setup, pose = part_of(task), setup_of(task), pose_of(task)
    generator = np.random.default_rng([task.seed, 103, task.part, task.operator, task.repeat])
    grip = Grip(recipe, FruitRig(fruit, pose, setup.unit, int(generator.integers(2**31))))
    pressed = grip.press(float(generator.uniform(0.0, 1.0)), setup.zero_mm)
    limit_mm = last_limit_mm(recipe)
    areas = judge(pressed.on_to_the_threshold, recipe).areas
    area_mm2 = next(area.area_mm2 for area in areas if area.closing_mm == limit_mm)
    counted_mm2 = 0.0 if pressed.late_mm is None else true_area_mm2(fruit, pose, pressed.late_mm + limit_mm)
    outcome, reference = judge(pressed.as_stopped, recipe).outcome, "FAIL" if fruit.bruised else "PASS"
    return Simulated(
        Measurement(*task.names, area_mm2 or 0.0, outcome, reference),
        (true_area_mm2(fruit, pose, limit_mm), counted_mm2),
    )


def good_and_damaged_mm2(fruit: str, seed: int) -> tuple[float, float]:
    """Return true areas at the last limit's closing, mean over the paper's 30 sizes: sound fruit, and the same bruised.

    Their difference is the tolerance.
    """
    closing_mm = last_limit_mm(find_recipe(fruit))

    def mean(*, bruised: bool) -> float:
        members = [member(fruit, seed, number) for number in range(PAPER_SAMPLES)]
        areas = [true_area_mm2(replace(one.fruit, bruised=bruised), one.pose, closing_mm) for one in members]
        return float(np.mean(areas))

    return mean(bruised=False), mean(bruised=True)
