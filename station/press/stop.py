"""Stop criteria: every reason for which the gripper closes no further.

| while | it stops | here |
|---|---|---|
| approaching | at the first frame with a firm contact | `touches` |
| approaching | below the smallest expected width, or held by what the gel does not show | `nothing_touched` |
| moving without a stop | as a measurement is late, until it has come | `longest_unseen_s` |
| closing without a stop | at the last threshold that a fruit has to keep | `steps_to_decide` |
| pressing | by what was measured: early stop, largest closing, outcome decided | `ends_steps` |
| pressing | by what the gripper did: number of steps, force limit, closed fingers | `is_last_step` |
| pressing | before a step that may be one too many, until the last one is measured | `may_decide` |

A fault, a late inspection and a called-off one stop the fingers by the cycle's table: `HALT` in
`station/inspection/cycle.py`, as does an end of the steps that is found while the next one is under way.
"""

from math import ceil

from station.inspection.evidence import AT_MM
from station.inspection.judge import early_stop
from station.inspection.press import Press
from station.messages import grip as messages
from station.press.rig import GripError, MeasuredStep, Position
from station.settings.recipe_model import Recipe

MOST_UNSEEN_MM = 3.0
"""So far the fingers may have gone since the frame that was measured last: as far as the twin's flesh bears without
yielding (the recipes' damage limits). What they go in fact is in docs/cycle-time.md."""


class NothingTouchedError(GripError):
    """The fingers closed down to the recipe's smallest width and nothing was there."""


class UnseenContactError(GripError):
    """The gripper holds something that the sensor does not see."""


def touches(seen: MeasuredStep) -> bool:
    """Return whether the approach ends: at a firm contact, since a weak one may be a mere change of the gel."""
    return seen.contact.is_firm


def lowest_mm(recipe: Recipe) -> float:
    """The width at which the approach ends in any case."""
    return recipe.expected_width.smallest_mm - recipe.steps.step_mm


def nothing_touched(recipe: Recipe, at: Position | None = None) -> GripError:
    """The error for fingers that closed without a contact; `at` is None where the end was reached count by count."""
    if at is not None and at.held:
        return UnseenContactError(messages.UNSEEN_CONTACT(width_mm=at.width_mm))
    expected = recipe.expected_width
    return NothingTouchedError(
        messages.NOTHING_TOUCHED(largest_mm=expected.largest_mm, smallest_mm=expected.smallest_mm, recipe=recipe.name)
    )


def longest_unseen_s(recipe: Recipe) -> float:
    """Return the longest time for the fingers to move since the capture of the frame that was measured last, s."""
    return MOST_UNSEEN_MM / recipe.gripper.speed_mm_s


def steps_to_decide(recipe: Recipe) -> int:
    """Count the steps from the first image to the last damage threshold that a fruit has to keep."""
    # A step that is `AT_MM` short of the threshold is at it, so that no further one is needed.
    return min(recipe.steps.number, ceil((recipe.damage.passing_closing_mm - AT_MM) / recipe.steps.step_mm))


def ends_steps(press: Press, recipe: Recipe) -> bool:
    """Return whether the judge's rule ends the steps, by what was measured so far; the rule has the reason."""
    return early_stop(press, recipe) is not None


def is_last_step(recipe: Recipe, closed_steps: int, next_width_mm: float, reached: Position) -> bool:
    """Return whether the captured step is the last that can be made, independent of what it shows.

    Args:
        closed_steps: steps of the recipe by which the fingers have closed since the first image.
        next_width_mm: of the step that would follow.
        reached: where the fingers came to rest.
    """
    return closed_steps >= recipe.steps.number or reached.held or next_width_mm <= 0


def may_decide(recipe: Recipe, closing_mm: float | None) -> bool:
    """Return whether a captured step may decide the outcome, so that its measurement comes before the next step.

    Args:
        closing_mm: of that step; None before the onset is known.
    """
    if not recipe.steps.stop_when_decided or closing_mm is None:
        return False
    return closing_mm >= recipe.damage.deciding_closing_mm - AT_MM
