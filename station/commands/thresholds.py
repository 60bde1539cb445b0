"""`station thresholds`: proposed limit from fruit marked good and bad, with the cost of both errors."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from station.config_option import config_option
from station.errors import BadInputError, StationError
from station.records.database import reading, records_folder
from station.records.marks import Mark, read_marked
from station.settings.configuration import load_configuration
from station.settings.recipe import Recipe, find_recipe, recipe_files
from station.settings.recipe_text import with_values
from station.whatif.limits import Costs, least_area_at, rate_interval
from station.whatif.marks import read_marks
from station.whatif.proposal import Proposal, figures_of, proposals
from station.whatif.proposal_page import lines_of, page_of
from station.whatif.replay import measured_otherwise, pressed_otherwise, recipe_of_snapshot, replay
from station.whatif.stored import StoredPress, read_stored, sequences, snapshots

_PART = 500


@click.command("thresholds")
@click.option("--recipe", "name", required=True, metavar="NAME", help="The fruit's recipe, by its name.")
@click.option(
    "--marks", type=click.Path(path_type=Path), metavar="CSV",
    help="With sequence,mark. [default: what `station records mark` has told]",
)  # fmt: skip
@click.option("--lots", multiple=True, metavar="LOT", help="Only these, may be repeated. [default: all]")
@click.option(
    "--false-accept", default=20.0, show_default=True, metavar="COST", type=click.FloatRange(0.01, 10_000),
    help="What a damaged fruit that passes costs, in sound fruit that are diverted.",
)  # fmt: skip
@click.option(
    "--damaged", default=0.05, show_default=True, metavar="SHARE", type=click.FloatRange(0.0001, 0.9),
    help="The share of damaged fruit on the line.",
)  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Where the results go.")
@click.option("--draft", type=click.Path(path_type=Path), metavar="FILE", help="Write a recipe with the limit too.")
@config_option
def thresholds(
    name: str,
    marks: Path | None,
    lots: tuple[str, ...],
    false_accept: float,
    damaged: float,
    out: Path,
    draft: Path | None,
    config: Path | None,
) -> None:
    """Propose the last damage threshold from fruit marked good and bad, with its uncertainty.

    Writes DIR/thresholds.html, with both errors over the limit, and thresholds.json. Nothing is put in force: a recipe
    written with --draft is a draft like any other, as by `station recipes import`.
    """
    site, costs = load_configuration(config), Costs(false_accept, damaged)
    recipe, folder = find_recipe(name, site.recipes_folder), records_folder(site.home)
    marked = _stored_marks(folder) if marks is None else read_marks(marks)
    stored, own, left_out = _marked(folder, recipe, lots, set(marked))
    for mark in ("good", "bad"):
        if not any(marked[each.sequence] == mark for each in stored):
            others = "".join(f"; {number} marked fruit are left out: {why}" for why, number in left_out.items())
            raise BadInputError(
                f"{marks or folder}: none of the fruit marked {mark} is a judged {recipe.name} in the records; a limit "
                f"needs fruit of both kinds{others}"
            )
    found = proposals(stored, marked, own, recipe, costs)
    if not found:
        raise BadInputError(
            f"{recipe.name}: no closing of the recipe's results was reached by nine of ten good fruit, or none of them "
            "could pass by any limit: press the marked fruit with a higher early stop, or look at why they are diverted"
        )
    best = found[0]
    proposed, text = _draft(recipe, best, name, site.recipes_folder)
    told = {
        "false_accept_cost": costs.false_accept,
        "damaged_share": costs.damaged_share,
        "of_other_revisions": dict(left_out),
        "proposed": figures_of(best, costs),
        "other_closings": [figures_of(each, costs) for each in found[1:]],
        "by_the_proposed_recipe": {mark: _rate(stored, marked, mark, own, proposed) for mark in ("good", "bad")},
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "thresholds.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
        (out / "thresholds.html").write_text(page_of(recipe.title, best, told), encoding="utf-8")
        if draft is not None:
            draft.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StationError(f"{error.filename or out}: {error.strerror or error}; free space and try again") from error
    for line in lines_of(told):
        click.echo(line)
    click.echo(f"see {out / 'thresholds.html'}" + (f"; the draft is {draft}" if draft else ""))


def _stored_marks(folder: Path) -> dict[int, Mark]:
    """Read the marks that people made by `station records mark`, or on the panel."""
    with reading(folder) as connection:
        told: dict[int, Mark] = {each.sequence: each.mark for each in read_marked(connection)}
    if not told:
        raise BadInputError("no fruit is marked: tell some by `station records mark`, or give --marks")
    return told


def _marked(
    folder: Path, recipe: Recipe, lots: Sequence[str], marked: set[int]
) -> tuple[list[StoredPress], dict[str, Recipe], Counter[str]]:
    """Read the marked inspections that have a curve, pressed and measured as by the recipe.

    Returns:
        They, the recipes that they were judged by, and how many others are left out, by the reason.
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


def _draft(recipe: Recipe, best: Proposal, name: str, folder: Path | None) -> tuple[Recipe, str]:
    """Return the recipe's text with the limit in the place of the one at its closing, or of the last.

    Earlier limits are lowered and later ones raised where necessary, since limits rise with the closing. The comment
    behind each changed value says where the new one comes from.
    """
    limits, limit = recipe.damage.area, round(best.limit_mm2, 1)
    marked = f"`station thresholds`: {len(best.good)} good and {len(best.bad)} bad fruit"
    of = "" if recipe.damage.size is None else "of a fruit of the reference length; "
    same = [place for place, each in enumerate(limits) if each.closing_mm == best.closing_mm]
    fits_last = len(limits) == 1 or best.closing_mm > limits[-2].closing_mm
    chosen = same[0] if same else len(limits) - 1 if fits_last else 0
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
    if recipe.early_stop.area_mm2 < limit:
        changes["early_stop.area_mm2"] = limit
        comments["early_stop.area_mm2"] = "the last limit"
    for path in recipe_files(folder):
        if find_recipe(path).name == recipe.name:
            text, proposed = with_values(path.read_text(encoding="utf-8-sig"), changes, str(path), comments)
            return proposed, text
    raise BadInputError(f"recipe {name}: there is no file of it to write a draft from")


def _rate(
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
