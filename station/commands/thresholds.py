"""`station thresholds`: proposed limit from fruit marked good and bad, with the cost of both errors."""

import json
from pathlib import Path

import click

from station.config_option import config_option
from station.errors import BadInputError, StationError
from station.records.database import reading, records_folder
from station.records.marks import Mark, read_marked
from station.settings.configuration import load_configuration
from station.settings.recipe import find_recipe
from station.whatif.limits import Costs
from station.whatif.marks import read_marks
from station.whatif.proposal import figures_of, proposals
from station.whatif.proposal_page import lines_of, page_of
from station.whatif.threshold_draft import count_results, draft_recipe, read_marked_presses


@click.command("thresholds")
@click.option("--recipe", "name", required=True, metavar="NAME", help="The fruit's recipe, by its name.")
@click.option(
    "--marks", type=click.Path(path_type=Path), metavar="CSV",
    help="With sequence,mark. [default: the marks of `station records mark`]",
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
    stored, own, left_out = read_marked_presses(folder, recipe, lots, set(marked))
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
    proposed, text = draft_recipe(recipe, best, name, site.recipes_folder)
    told = {
        "false_accept_cost": costs.false_accept,
        "damaged_share": costs.damaged_share,
        "of_other_revisions": dict(left_out),
        "proposed": figures_of(best, costs),
        "other_closings": [figures_of(each, costs) for each in found[1:]],
        "by_the_proposed_recipe": {
            mark: count_results(stored, marked, mark, own, proposed) for mark in ("good", "bad")
        },
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
        found: dict[int, Mark] = {each.sequence: each.mark for each in read_marked(connection)}
    if not found:
        raise BadInputError("no fruit is marked: mark some with `station records mark`, or give --marks")
    return found
