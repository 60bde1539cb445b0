"""`station whatif`: stored inspections judged again by a draft of a recipe."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from station.config_option import config_option
from station.errors import BadInputError, StationError
from station.recipe_store.difference import Difference, differences
from station.records.database import reading, records_folder
from station.records.marks import Mark, read_marked
from station.settings.configuration import load_configuration
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256
from station.whatif.against_marks import Compared, compared
from station.whatif.outcome_table import Counted, as_csv, counted
from station.whatif.page import MOST_SHOWN, Page, as_json, fruit_views, render
from station.whatif.progress_file import ProgressFile
from station.whatif.replay import Replayed, recipe_of_snapshot
from station.whatif.runner import batches, run
from station.whatif.stored import sequences, snapshots_of


@click.command("whatif")
@click.option("--recipe", "recipe_name", required=True, metavar="DRAFT", help="A recipe's name, or a file's path.")
@click.option("--lots", multiple=True, metavar="LOT", help="Only these, may be repeated. [default: all]")
@click.option("--last", type=click.IntRange(1), metavar="N", help="Only the last N inspections.")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Where the results go.")
@click.option("--jobs", type=click.IntRange(1, 512), metavar="N", help="Processes. [default: one for each core]")
@click.option("--scheduler", metavar="ADDRESS", help="A Dask scheduler's address, as tcp://10.0.0.5:8786.")
@config_option
def whatif(
    recipe_name: str,
    lots: tuple[str, ...],
    last: int | None,
    out: Path,
    jobs: int | None,
    scheduler: str | None,
    config: Path | None,
) -> None:
    """Judge stored inspections again by DRAFT, and show which fruit would have changed sides.

    Fruit that people have marked good or bad are counted by the errors. Writes DIR/whatif.html, changes.csv and
    summary.json. An interrupted run continues when it is repeated. What cannot
    be known, as after an early stop, is counted apart and never guessed.
    """
    site = load_configuration(config)
    draft, folder = find_recipe(recipe_name, site.recipes_folder), records_folder(site.home)
    with reading(folder) as connection:
        wanted = sequences(connection, draft.name, lots, last)
        own = snapshots_of(connection, wanted)
        marks: dict[int, Mark] = {each.sequence: each.mark for each in read_marked(connection)}
    if not wanted:
        raise BadInputError(f"no judged inspection of {draft.name} is in {folder}" + _of(lots))
    with ProgressFile(out, draft) as progress:
        missing = [sequence for sequence in wanted if sequence not in progress.done]
        parts = batches(folder, missing, own, draft)
        with click.progressbar(length=len(wanted), label="judged again", file=sys.stderr) as bar:
            bar.update(len(wanted) - len(missing))
            for results in run(parts, jobs or os.cpu_count() or 1, scheduler):
                progress.add(results)
                bar.update(len(results))
        results = [progress.done[sequence] for sequence in wanted if sequence in progress.done]
    told, against = counted(results), compared(results, marks)
    page = _page(folder, results, told, against, own, draft, lots)
    try:
        (out / "whatif.html").write_text(page, encoding="utf-8")
        (out / "changes.csv").write_text(as_csv(results), encoding="utf-8")
        (out / "summary.json").write_text(as_json(told, against), encoding="utf-8")
    except OSError as error:
        raise StationError(
            f"--out {out}: {(error.strerror or str(error)).lower()}; free space and try again"
        ) from error
    _say(told, against, out)


def _page(
    folder: Path,
    results: list[Replayed],
    told: Counted,
    against: Compared | None,
    own: dict[str, str],
    draft: Recipe,
    lots: tuple[str, ...],
) -> str:
    recipes = {sha256: recipe_of_snapshot(text) for sha256, text in own.items()}
    changed = [each for each in results if each.changes_side]
    with reading(folder) as connection:
        tiles = fruit_views(connection, folder, changed[:MOST_SHOWN], recipes, draft)
    facts = [
        ("draft", f"{draft.title}, {content_sha256(draft)[:12]}"),
        ("inspections", f"{results[0].sequence} to {results[-1].sequence}{_of(lots)}"),
        ("recipes at the time", ", ".join(sha256[:12] for sha256 in own)),
    ]
    changes = _changes(list(recipes.values()), draft)
    return render(Page(f"What if: {draft.title}", facts, changes, told, against, tiles, len(changed)))


def _changes(recipes: Sequence[Recipe | None], draft: Recipe) -> Sequence[Difference] | str:
    """Return what the draft changes of the recipe of all fruit, or a text with the reason why it is not known."""
    if len(recipes) > 1:
        return f"These fruit were inspected by {len(recipes)} revisions, so there is no single one to compare with."
    (own,) = recipes
    if own is None:
        return "Not known: this version does not accept the recipe by which these fruit were inspected."
    return differences(own, draft)


def _of(lots: tuple[str, ...]) -> str:
    return f", of lot {', '.join(lots)}" if lots else ""


def _say(told: Counted, against: Compared | None, out: Path) -> None:
    click.echo(f"{told.total} inspections, {told.decided} decided by the draft")
    click.echo(f"diverted: {told.rejects_before()} before, {told.rejects_after()} after")
    click.echo(f"{told.newly_rejected} newly diverted, {told.newly_passed} newly passed")
    for line in [] if against is None else against.lines():
        click.echo(line)
    if told.measured_again:
        click.echo(f"{told.measured_again} measured again in their stored images")
    for why, number in told.undecidable.most_common(5):
        click.echo(f"cannot be known: {number}: {why}")
    if told.unfaithful:
        click.echo(f"{told.unfaithful} are not as their own recipe judges them today")
    click.echo(f"see {out / 'whatif.html'}")
