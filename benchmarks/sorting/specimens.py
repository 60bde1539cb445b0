"""The fruit that the sorting run presses, each with its own sensor unit, gripper zero, phase, placing and tilt."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from station.studies.cohort import PLACE_PX, TILT_DEG, TURN_DEG
from station.studies.gauge_grip import CALIBRATION_SD
from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.damage import DAMAGES, Severity
from station.twin.fruit import Fruit, Kind, draw_fruit

KINDS = (Kind.BLUEBERRY, Kind.RASPBERRY, Kind.STRAWBERRY)
SOUND = "sound"
GROUPS = (SOUND, *Severity)
ON_UNITS = "units"
"""The set of fruit that is pressed by a few units in turn."""
SEEDS = {"tuning": 20, "tuning-2": 21, "tuning-3": 22, "tuning-4": 23, "judging": 24, ON_UNITS: 25}
"""Sets of fruit that never meet: recipes are tuned on the others and judged on the last two, which no limit was chosen
on. The tuning sets but the first were judged on once, until something was chosen on them as well."""
UNITS = 20
"""Units of `ON_UNITS`, at even distances over the whole range of scales."""

_ZERO_SD_MM = 0.2
_HABIT_PX, _HABIT_DEG = 10.0, 3.0
"""As the gauge study draws an operator's set-up; here it is drawn anew for each fruit, as how the fruit is laid in."""
_SCALES_MM_PER_PX = (0.0255, 0.0291)
"""What is published for single DIGIT units."""
_GRADER_MM = 1.0
"""A grader's length is within this of the true one, uniform."""


class SensorUnit(NamedTuple):
    """One sensor."""

    light: int
    """Seed of its light."""
    mm_per_px: float
    """Its true scale."""


class Task(NamedTuple):
    """One fruit of a set."""

    kind: Kind
    group: str
    """One of `GROUPS`."""
    seeds: str
    """A key of `SEEDS`."""
    number: int


@dataclass(frozen=True, slots=True)
class Specimen:
    """A fruit, how it lies, and the cell that presses it."""

    fruit: Fruit
    pose: Pose
    unit: int
    """Seed of the sensor's light."""
    mm_per_px: float
    """The unit's true scale."""
    calibrated_mm_per_px: float
    """What its calibration found."""
    zero_mm: float
    """By how much every width is read too large."""
    phase: float
    """Where the fruit's width lies between two counts of the gripper, 0 to 1."""
    noise_seed: int
    graded_mm: float
    """The length as a grader has it."""


def sensor_unit(number: int) -> SensorUnit:
    """One of the units that press the fruit of `ON_UNITS`, the finest scale first.

    Args:
        number: from 0; they come again after `UNITS`.
    """
    finest, coarsest = _SCALES_MM_PER_PX
    place = number % UNITS
    return SensorUnit(1000 + place, finest + (coarsest - finest) * place / (UNITS - 1))


def draw(task: Task) -> Specimen:
    """Draw a fruit and its cell; the same task gives the same.

    Args:
        task: which.
    """
    generator = np.random.default_rng(
        [SEEDS[task.seeds], KINDS.index(task.kind), GROUPS.index(task.group), task.number]
    )
    fruit_seed, unit, noise_seed = (int(one) for one in generator.integers(2**31, size=3))
    fruit = draw_fruit(task.kind, fruit_seed)
    if task.group != SOUND:
        fruit = replace(fruit, bruised=True, damage=DAMAGES[Severity(task.group)])
    shift_px = generator.normal(0.0, _HABIT_PX, 2) + generator.normal(0.0, PLACE_PX, 2)
    turn_deg = generator.normal(0.0, _HABIT_DEG) + generator.normal(0.0, TURN_DEG)
    mm_per_px = float(generator.uniform(*_SCALES_MM_PER_PX))
    if task.seeds == ON_UNITS:
        unit, mm_per_px = sensor_unit(task.number)
    return Specimen(
        fruit=fruit,
        pose=Pose(MIDDLE_X_PX + shift_px[0], MIDDLE_Y_PX + shift_px[1], turn_deg, generator.normal(0.0, TILT_DEG)),
        unit=unit,
        mm_per_px=mm_per_px,
        calibrated_mm_per_px=mm_per_px * (1.0 + float(generator.normal(0.0, CALIBRATION_SD))),
        zero_mm=float(generator.normal(0.0, _ZERO_SD_MM)),
        phase=float(generator.uniform()),
        noise_seed=noise_seed,
        graded_mm=fruit.length_mm + float(generator.uniform(-_GRADER_MM, _GRADER_MM)),
    )
