"""A gauge study of the gauge alone: firm balls in a jig, pressed down to a stop, in place of fruit.

A fruit laid in anew shows another true area, and the gripper's counts meet it at another closing. Neither is the fault
of what looks at the gel, so both are held as a metrologist would hold them: the jig keeps the ball's place, and a stop
in it, on which the jaws come to rest, the width. Then an operator's habit and gripper zero change nothing; what is left
of an operator is the sensor unit. Every repeat takes the ball out and lays it in again.
"""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from station.settings.recipe import find_recipe
from station.studies.gauge_grip import Grip, true_area_mm2
from station.studies.gauge_table import Measurement
from station.studies.gauge_twin import GaugeTask, Simulated, setup_of
from station.twin.contact import Pose
from station.twin.fruit import Fruit, Kind, draw_fruit
from station.twin.gel import MM_PER_PX

SMALLEST_MM, LARGEST_MM = 20.0, 38.0
PLAY_MM, STOP_MM = 0.05, 0.02
"""Standard deviations of the ball's place in the jig and of the width at the stop; our estimates."""
DUMMY_TRUTHS = ("Jig and stop: true areas at the width as it was",)
"""What the true areas vary with."""
_MOST_READINGS = 5
_CLOSINGS_MM = np.arange(0.5, 10.0, 0.5)


def ball_of(task: GaugeTask, parts: int) -> Fruit:
    """The ball; sizes are evenly apart.

    Args:
        task: whose part.
        parts: how many there are, at least 2.
    """
    return _ball(SMALLEST_MM + (LARGEST_MM - SMALLEST_MM) * task.part / (parts - 1))


def _ball(across_mm: float) -> Fruit:
    return replace(draw_fruit(Kind.RUBBER_BALL, 0), width_mm=across_mm, length_mm=across_mm)


@cache
def stop_mm(fruit: str) -> float:
    """How far the stop lets each ball be pressed, mm: until the largest shows the recipe's last area limit.

    So the areas end where the decision falls. Beyond a strawberry's, a smooth body leaves the gel no background, and
    the method flags more and more of them.

    Args:
        fruit: the recipe's name.
    """
    largest = _ball(LARGEST_MM)
    areas = [true_area_mm2(largest, Pose(), closing_mm) for closing_mm in _CLOSINGS_MM]
    return round(float(np.interp(find_recipe(fruit).damage.area[-1].area_mm2, areas, _CLOSINGS_MM)), 1)


def measure_dummy(task: GaugeTask, parts: int) -> Simulated:
    """Press a ball down to its stop and measure that one step as the fruit's recipe does.

    What the method itself flags is no reading: the ball is laid in and pressed again, and the refusals are counted. The
    fifth is taken as it is; a contact that was not found has 0 mm².

    Args:
        task: which ball, who and how often; its fruit names the recipe.
        parts: how many balls there are.

    Returns:
        The measurement with the truth of `DUMMY_TRUTHS`.
    """
    cv2.setNumThreads(1)
    recipe, ball, unit = find_recipe(task.fruit), ball_of(task, parts), setup_of(task).unit
    generator = np.random.default_rng([task.seed, 104, task.part, task.operator, task.repeat])
    refused = 0
    while True:
        x_px, y_px = generator.normal(0.0, PLAY_MM / MM_PER_PX, 2)
        closing_mm = stop_mm(task.fruit) + float(generator.normal(0.0, STOP_MM))
        pose = Pose(240.0 + x_px, 320.0 + y_px)
        contact = Grip(recipe, ball, pose, unit, int(generator.integers(2**31))).held(closing_mm)
        if not contact.flags or refused == _MOST_READINGS - 1:
            break
        refused += 1
    measurement = Measurement(*task.names, contact.area_px * MM_PER_PX**2)
    return Simulated(measurement, (true_area_mm2(ball, pose, closing_mm),), refused)
