"""Cycle time budget: the deadlines of an inspection and its phases on this cell, and what is late now."""

import time
from itertools import combinations, pairwise

from station.devices.arm.ur import POSES
from station.errors import BadInputError
from station.inspection.deadlines import LONGEST_S, Deadlines, Late, Pace, deadlines, late
from station.inspection.states import State
from station.messages.operation import DEADLINE_TOO_SHORT
from station.messages.recipes import NOT_FOR_INSPECTIONS
from station.runtime.cycle.inspection import Inspection
from station.runtime.devices.rig import Cell
from station.settings.arm import ArmSettings, PoseName
from station.settings.configuration import Configuration
from station.settings.recipe_model import Recipe

RECORD_NO_RESULT_S = 1.0
"""For a NO_RESULT to become durable, past the inspection's own deadline."""
_MEASURE_S = 0.1
"""Measurement of one image on an idle machine, s: an estimate."""
_FRAMES_PER_S = 30.0
"""Frame rate of a camera that does not report its own: an estimate."""


class Pacing:
    """The deadlines of one cell, whose camera reports its rate once it is open."""

    def __init__(self, configuration: Configuration, cell: Cell) -> None:
        self._configuration, self._cell = configuration, cell

    def expected(self, recipe: Recipe) -> Deadlines:
        """The deadlines of a recipe's inspection on a machine that has nothing else to do.

        Raises:
            BadInputError: an inspection would take longer than the longest deadline that the PLC interface accepts.
        """
        cell, configuration = self._cell, self._configuration
        pace = Pace(
            frames_per_s=cell.camera.description.frames_per_s or _FRAMES_PER_S,
            arm_move_s=0.0 if cell.arm is None else longest_move_s(configuration.arm),
            arm_way_s=0.0 if cell.arm is None else way_s(configuration.arm, "home", "above_nest", "nest"),
            opening_mm_s=configuration.gripper.opening_speed_mm_s,
            stroke_mm=cell.gripper.max_width_mm,
            record_s=configuration.records.deadline_s,
            measure_s=_MEASURE_S,
        )
        return deadlines(recipe, pace)

    def check(self, recipe: Recipe) -> None:
        """Check that fruit can pass by a recipe that is to become active, within the site's deadline.

        Raises:
            BadInputError: no fruit passes by its method, the deadline leaves no time for its longest way, or an
                inspection would take longer than the longest deadline that the PLC interface accepts.
        """
        if recipe.segmentation.method == "paper":  # of a file that was adopted: nobody may submit it
            raise BadInputError(NOT_FOR_INSPECTIONS(recipe=recipe.name))
        needed_s = self.expected(recipe).longest_path_s
        allowed_s = self._configuration.service.inspection_deadline_s
        if allowed_s is not None and allowed_s < needed_s:
            raise BadInputError(DEADLINE_TOO_SHORT(recipe=recipe.name, needed_s=needed_s, allowed_s=allowed_s))

    def limits(self, recipe: Recipe) -> Deadlines:
        """The limits of a recipe that `check` has passed, with the site's patience and its deadline of all of it."""
        expected, settings = self.expected(recipe), self._configuration.service
        own_s = min(settings.patience * expected.inspection_s, LONGEST_S)
        return expected._replace(
            phases_s={state: settings.patience * limit_s for state, limit_s in expected.phases_s.items()},
            inspection_s=own_s if settings.inspection_deadline_s is None else settings.inspection_deadline_s,
        )


def late_now(now: Inspection, state: State, in_state_s: float) -> Late | None:
    """Return the passed deadline of an accepted inspection, if any."""
    if now.accepted_s is None:
        return None
    since_s = None if now.standing is not None else time.monotonic() - now.accepted_s
    return late(now.limits, state, in_state_s, since_s)


def longest_move_s(arm: ArmSettings) -> float:
    """The longest way between two of the arm's places."""
    return max(way_s(arm, *pair) for pair in combinations(POSES, 2))


def way_s(arm: ArmSettings, *poses: PoseName) -> float:
    """The time of a way over two places or more, with a stop at each: its leading joint speeds up, travels, brakes."""
    places = [arm.poses.joints_rad(pose) for pose in poses]
    ways_rad = [max(abs(a - b) for a, b in zip(*pair, strict=True)) for pair in pairwise(places)]
    ramp_s = arm.joint_speed_rad_s / arm.joint_acceleration_rad_s2
    return sum(way_rad / arm.joint_speed_rad_s + ramp_s for way_rad in ways_rad)
