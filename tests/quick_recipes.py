"""Recipes of quick inspections, for tests of whole stations."""

import json
from pathlib import Path

from station.settings.recipe import load_recipes

NUMBERS = {"strawberry": 1, "blueberry": 2, "raspberry": 3}
"""Each recipe's number for the PLC."""


def quick_recipes(folder: Path, settle_s: float = 0.02) -> Path:
    """Write the shipped recipes with few steps of one frame each, and return their folder."""
    folder.mkdir(exist_ok=True)
    shipped = load_recipes()
    for name in NUMBERS:
        values = shipped[name].model_dump(mode="json")
        limits_mm = [limit["closing_mm"] for limit in values["damage"]["area"]]
        values["steps"] |= {"number": 4, "result_closings_mm": limits_mm, "closing_limit_mm": 4.5}
        values["imaging"] |= {"settle_s": settle_s, "frames_per_step": 1, "reference_frames": 3}
        values["damage"]["growth_mm2_per_mm"] = 60
        # The unit is not calibrated and no grader tells a size: by a usual coverage no fruit would pass.
        values["damage"].pop("size", None)
        values["damage"]["uncertainty"] = {"coverage": 0.6, "repeatability": [{"closing_mm": 3.0, "relative": 0.03}]}
        values["early_stop"] = {"area_mm2": 150, "growth_mm2_per_mm": 90}
        values["expected_width"]["largest_mm"] = min(values["expected_width"]["largest_mm"], 42.0)
        (folder / f"{name}.yaml").write_text(json.dumps(values))
    return folder
