"""Recipes of quick inspections, for tests of whole stations."""

import json
from pathlib import Path

from benchmarks.reliability.quick_recipe import few_steps, values_with
from station.settings.recipe import load_recipes

NUMBERS = {"strawberry": 1, "blueberry": 2, "raspberry": 3}
"""Each recipe's number for the PLC."""


def quick_recipes(folder: Path, settle_s: float = 0.02) -> Path:
    """Write the shipped recipes with few steps of one frame each, and return their folder."""
    folder.mkdir(exist_ok=True)
    shipped = load_recipes()
    for name in NUMBERS:
        values = values_with(shipped[name], few_steps(shipped[name], settle_s))
        (folder / f"{name}.yaml").write_text(json.dumps(values))
    return folder
