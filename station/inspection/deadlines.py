"""How long a phase and an inspection may take, from the recipe; late is a comparison of values."""

from typing import NamedTuple

from station.inspection.states import State
from station.settings.recipe_model import Recipe


class Pace(NamedTuple):
    """What the times of one cell follow from."""

    frames_per_s: float
    arm_move_s: float
    """The longest motion of the arm between two of its places."""
    stroke_mm: float
    """Width of the open jaws."""
    record_s: float
    """A durable write, on a slow disk."""
    measure_s: float
    """The measurement of one image."""


class Deadlines(NamedTuple):
    """Seconds from a phase's begin, or from the accepted trigger."""

    phases_s: dict[State, float]
    """For every state in which something is waited for."""
    inspection_s: float
    """From the accepted trigger to the durable outcome."""


class Late(NamedTuple):
    """A deadline that has passed."""

    phase: State | None
    """None for the whole inspection."""
    took_s: float
    allowed_s: float


def deadlines(recipe: Recipe, pace: Pace) -> Deadlines:
    """The deadlines of a recipe's inspection on a cell.

    Args:
        recipe: steps, speeds, settling and frames.
        pace: the cell's.
    """
    return Deadlines({}, 60.0)


def late(limits: Deadlines, phase: State, in_phase_s: float, since_trigger_s: float | None) -> Late | None:
    """What is late now, the inspection before the phase.

    Args:
        limits: from `deadlines`.
        phase: the cycle's state now.
        in_phase_s: time since it was entered.
        since_trigger_s: time since the trigger was accepted; None outside an inspection.
    """
    return None
