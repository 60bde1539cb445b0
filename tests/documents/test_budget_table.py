"""The quality guide's budget by fruit is that of the shipped recipes."""

from pathlib import Path

from station.inspection.fruit_size import FruitSize
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.inspection.uncertainty import COMPONENTS, Budget, budget_at
from station.settings.gripper import GripperCalibration
from station.settings.recipe import load_recipes
from station.settings.recipe_model import Recipe

GUIDE = Path(__file__).parents[2] / "docs" / "quality.md"
BEGIN, END = "<!-- budget -->\n", "<!-- /budget -->\n"
SCALE = 0.0125
"""A scale calibrated to 2.5 %, two standard deviations, as docs/calibration.md has it."""
FRUIT = ("strawberry", "raspberry", "blueberry")


def budget(recipe: Recipe, *, sized: bool = True) -> Budget:
    """Of a fruit of the reference length, met a count of the gripper after the last image without contact."""
    count_mm = GripperCalibration().mm_per_count
    assert recipe.damage.size is not None
    size = FruitSize(recipe.damage.size.reference_mm if sized else None)
    press = Press(None, count_mm, (), size=size, resolution_mm=count_mm, scale_uncertainty=SCALE)
    return budget_at(recipe.damage.deciding_closing_mm, press, sized_limits(press, recipe))


def table() -> str:
    recipes = [load_recipes()[name] for name in FRUIT]
    known, unknown = [budget(recipe) for recipe in recipes], [budget(recipe, sized=False) for recipe in recipes]
    rows = [
        ["share of the area, %", *(f"{recipe.title}, {recipe.damage.deciding_closing_mm:g} mm" for recipe in recipes)],
        ["---"] * (1 + len(recipes)),
    ]
    rows += [
        [text, *(f"{100 * each.components[place].relative:.1f}" for each in known)]
        for place, text in enumerate(COMPONENTS.values())
    ]
    rows.append(["combined", *(f"{100 * each.combined:.1f}" for each in known)])
    rows.append([f"guard band, {known[0].factor:.2f} times that", *(f"{100 * each.expanded:.1f}" for each in known)])
    rows.append(["guard band without the size", *(f"{100 * each.expanded:.1f}" for each in unknown)])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def test_the_guides_budget_is_that_of_the_shipped_recipes():
    shown = GUIDE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    assert shown == table(), f"put this between its marks in docs/quality.md:\n{table()}"
