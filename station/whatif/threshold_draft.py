"""Draft of a recipe with a proposed limit: the marked presses behind it, the recipe's text, and the results by it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from station.errors import BadInputError
from station.recipe_store.reader import text_with_base
from station.records.database import reading
from station.records.marks import Mark
from station.settings.recipe import check_recipes, recipe_files
from station.settings.recipe_model import Recipe
from station.settings.recipe_text import with_values
from station.whatif.limits import least_area_at, rate_interval
from station.whatif.proposal import Proposal
from station.whatif.replay import measured_otherwise, pressed_otherwise, recipe_of_snapshot, replay
from station.whatif.stored import StoredPress, read_stored, sequences, snapshots

_PART = 500
"""Inspections read at one time; an estimate."""


def read_marked_presses(
    folder: Path, recipe: Recipe, lots: Sequence[str], marked: set[int]
) -> tuple[list[StoredPress], dict[str, Recipe], Counter[str]]:
    """Read the marked inspections that have a curve, pressed and measured as by the recipe.

    Returns:
        The inspections, the recipes that judged them, and the number left out by reason.
    """
    with reading(folder) as connection:
        wanted = [sequence for sequence in sequences(connection, recipe.name, lots, None) if sequence in marked]
        revisions = {sha256: recipe_of_snapshot(text) for sha256, text in snapshots(connection, recipe.name).items()}
        parts = [wanted[start : start + _PART] for start in range(0, len(wanted), _PART)]
        stored = [each for part in parts for each in read_stored(connection, part, folder, with_images=False)]
    why_not = {sha256: _why_no_evidence(own, recipe) for sha256, own in revisions.items()}
    left_out = Counter(why for each in stored if (why := why_not[each.recipe_sha256]))
    kept = [each for each in stored if not why_not[each.recipe_sha256] and each.press.onset_mm is not None]
    return kept, {sha256: own for sha256, own in revisions.items() if own is not None}, left_out


def _why_no_evidence(own: Recipe | None, recipe: Recipe) -> str | None:
    """Return why the areas of a revision's fruit are no evidence for a limit of the recipe; None if they are."""
    if own is None:
        return "this version does not accept their revision"
    if otherwise := pressed_otherwise(own, recipe):
        return f"their revision pressed otherwise ({otherwise.parameters['fields']})"
    return "their revision measured otherwise" if measured_otherwise(own, recipe) else None


def draft_recipe(recipe: Recipe, best: Proposal, name: str, folder: Path | None) -> tuple[Recipe, str]:
    """Return the draft and its text: the limit replaces the one at its closing, else the next one, else the last.

    Earlier limits are lowered and later ones raised where necessary, since limits rise with the closing. The comment
    behind each changed value says where the new one comes from, and the first line names the version that was changed,
    so that an import notices a change meanwhile.
    """
    limits, limit = recipe.damage.area, round(best.limit_mm2, 1)
    marked = f"`station thresholds`: {len(best.good)} good and {len(best.bad)} bad fruit"
    of = "" if recipe.damage.size is None else "of a fruit of the reference length; "
    # The first that is not before it, so that the closings still ascend.
    chosen = next((place for place, each in enumerate(limits) if each.closing_mm >= best.closing_mm), len(limits) - 1)
    changes: dict[str, Any] = {
        f"damage.area[{place}].area_mm2": limit
        for place, each in enumerate(limits)
        if (place < chosen and each.area_mm2 > limit) or (place > chosen and each.area_mm2 < limit)
    }
    comments = dict.fromkeys(changes, f"not beyond the limit at {best.closing_mm:g} mm, which is new")
    changes[f"damage.area[{chosen}].area_mm2"] = limit
    comments[f"damage.area[{chosen}].area_mm2"] = of + marked
    if limits[chosen].closing_mm != best.closing_mm:
        changes[f"damage.area[{chosen}].closing_mm"] = best.closing_mm
        comments[f"damage.area[{chosen}].closing_mm"] = f"{marked}, where they are told apart at the least cost"
        least = round(least_area_at(recipe, best.closing_mm), 1)
        if least != limits[chosen].least_area_mm2:
            changes[f"damage.area[{chosen}].least_area_mm2"] = least
            comments[f"damage.area[{chosen}].least_area_mm2"] = "from those before, as the area goes with the closing"
    if chosen and recipe.damage.decided_by == "first_trusted":
        changes["damage.decided_by"] = "every_limit"
        comments["damage.decided_by"] = "what is proposed decides on every fruit"
    if recipe.damage.size is not None and recipe.damage.size.exponent != best.exponent:
        changes["damage.size.exponent"] = best.exponent
        comments["damage.size.exponent"] = f"regression over these fruit; {marked}"
    # A recipe whose early stop is below a limit is refused.
    if recipe.early_stop.area_mm2 < limit:
        changes["early_stop.area_mm2"] = limit
        comments["early_stop.area_mm2"] = "the last limit"
    for path, present in check_recipes(recipe_files(folder)).recipes.items():
        if present.name == recipe.name:
            text, proposed = with_values(path.read_text(encoding="utf-8-sig"), changes, str(path), comments)
            return proposed, text_with_base(text, present)
    raise BadInputError(f"recipe {name}: there is no file of it to write a draft from")


def count_results(
    stored: Sequence[StoredPress], marked: Mapping[int, Mark], mark: Mark, own: dict[str, Recipe], proposed: Recipe
) -> dict[str, Any]:
    """Judge the marked fruit by the proposed recipe and count the results."""
    group = [each for each in stored if marked[each.sequence] == mark]
    after = [replay(each, own[each.recipe_sha256], proposed).after for each in group]
    decided = [each for each in after if each != "UNDECIDABLE"]
    rejected = sum(each != "PASS" for each in decided)
    interval = rate_interval(rejected, len(decided))
    return {
        "marked": len(group),
        "decided": len(decided),
        "rejected": rejected,
        "rejected_share": rejected / len(decided) if decided else None,
        "interval": [interval.low, interval.high],
    }
