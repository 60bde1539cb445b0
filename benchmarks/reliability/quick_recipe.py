"""Quick recipes: the shipped ones with few steps, for a whole station that inspects fruit for another reason."""

from collections.abc import Mapping
from typing import Any

from station.settings.recipe_model import Recipe

JUDGED: Mapping[str, Any] = {
    "damage.growth_mm2_per_mm": 60,
    # The unit is not calibrated and no grader gives a size: by a usual coverage no fruit would pass.
    "damage.size": None,
    "damage.uncertainty": {"coverage": 0.6, "repeatability": [{"closing_mm": 3.0, "relative": 0.03}]},
    "early_stop.area_mm2": 150,
    "early_stop.growth_mm2_per_mm": 90,
}
"""Values by their paths with which sound fruit pass after few steps."""
_LARGEST_MM = 42.0


def few_steps(recipe: Recipe, settle_s: float = 0.02) -> dict[str, Any]:
    """Return values by their paths for few steps of one frame each.

    Args:
        recipe: a shipped one.
        settle_s: its rest after each step.
    """
    return {
        "steps.number": 4,
        "steps.result_closings_mm": [limit.closing_mm for limit in recipe.damage.area],
        "steps.closing_limit_mm": 4.5,
        "imaging.settle_s": settle_s,
        "imaging.frames_per_step": 1,
        "imaging.reference_frames": 3,
        **JUDGED,
    }


def values_with(recipe: Recipe, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a recipe's values with some changed, for no very large fruit.

    Args:
        recipe: a shipped one.
        changes: new values by their paths.
    """
    values = recipe.model_dump(mode="json")
    values["expected_width"]["largest_mm"] = min(recipe.expected_width.largest_mm, _LARGEST_MM)
    for path, value in changes.items():
        *enclosing, name = path.split(".")
        holder = values
        for each in enclosing:
            holder = holder[each]
        holder[name] = value
    return values
