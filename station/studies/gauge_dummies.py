"""Gauge study without fruit: firm balls in a jig, pressed down to a stop.

A fruit laid in anew shows another true area, and the gripper's counts meet it at another closing. Neither is the
sensor's fault, so both are fixed as a metrologist would fix them: the jig fixes the ball's place, and a stop in it,
against which the jaws close, the width. Then an operator's habit and gripper zero change nothing; the only difference
left between operators is the sensor unit. Every repeat takes the ball out and lays it in again.
"""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from station.settings.recipe import find_recipe
from station.studies.gauge_grip import FruitRig, Grip, true_area_mm2
from station.studies.gauge_table import Measurement
from station.studies.gauge_twin import GaugeTask, Simulated, setup_of
from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.fruit import Fruit, Kind, draw_fruit
from station.twin.gel import MM_PER_PX

SMALLEST_MM, LARGEST_MM = 20.0, 38.0
"""Diameters of the smallest and the largest ball, so that their areas reach from below a sound fruit's to the limit."""
PLAY_MM, STOP_MM = 0.05, 0.02
"""Standard deviations of the ball's place in the jig and of the width at the stop. Estimates."""
DUMMY_TRUTHS = ("Jig and stop: true areas at the width as it was",)
"""Causes of variation of the true areas."""
_MOST_READINGS = 5
"""Readings of one measurement, of which the last is accepted in any case. An estimate."""
_CLOSINGS_MM = np.arange(0.5, 10.0, 0.5)
"""Closings at which the largest ball's area is computed, to interpolate the stop's. A resolution."""


def ball_of(task: GaugeTask, parts: int) -> Fruit:
    """Return the ball; the sizes of at least 2 are evenly spaced."""
    return _ball(SMALLEST_MM + (LARGEST_MM - SMALLEST_MM) * task.part / (parts - 1))


def _ball(across_mm: float) -> Fruit:
    return replace(draw_fruit(Kind.RUBBER_BALL, 0), width_mm=across_mm, length_mm=across_mm)


@cache
def stop_mm(fruit: str) -> float:
    """Return the closing at the stop, mm: there the largest ball shows the last area limit of the fruit's recipe.

    So the areas end at the decision. Beyond a strawberry's area, a smooth ball leaves no background on the gel, and the
    method flags more and more of them.
    """
    largest = _ball(LARGEST_MM)
    areas = [true_area_mm2(largest, Pose(), closing_mm) for closing_mm in _CLOSINGS_MM]
    return round(float(np.interp(find_recipe(fruit).damage.area[-1].area_mm2, areas, _CLOSINGS_MM)), 1)


def measure_dummy(task: GaugeTask, parts: int) -> Simulated:
    """Press a ball down to its stop and measure that one step by the fruit's recipe.

    A flagged measurement is no reading: the ball is laid in and pressed again, and the refusals are counted. The fifth
    is accepted in any case; a contact that was not found has 0 mm².

    Returns:
        The measurement with the truth of `DUMMY_TRUTHS`.
    """
    # So that --jobs gives the number of cores used.
    cv2.setNumThreads(1)
    recipe, ball, unit = find_recipe(task.fruit), ball_of(task, parts), setup_of(task).unit
    generator = np.random.default_rng([task.seed, 104, task.part, task.operator, task.repeat])
    refused = 0
    while True:
        x_px, y_px = generator.normal(0.0, PLAY_MM / MM_PER_PX, 2)
        closing_mm = stop_mm(task.fruit) + float(generator.normal(0.0, STOP_MM))
        pose = Pose(MIDDLE_X_PX + x_px, MIDDLE_Y_PX + y_px)
        contact = Grip(recipe, FruitRig(ball, pose, unit, int(generator.integers(2**31)))).held(closing_mm)
        if not contact.flags or refused == _MOST_READINGS - 1:
            break
        refused += 1
    measurement = Measurement(*task.names, contact.area_px * MM_PER_PX**2)
    return Simulated(measurement, (true_area_mm2(ball, pose, closing_mm),), refused)
