"""`station recipes`: manage recipes, their revisions and approvals."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from station.clock import formatted
from station.config_option import config_option
from station.errors import BadInputError
from station.recipe_store.difference import differences
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.recipe_store.recipe_state import FileState, RecipeState
from station.recipe_store.revision import Revision, Status
from station.recipe_store.store import RecipeStore
from station.settings.configuration import load_configuration
from station.settings.problems import SettingsError, shortened, shortened_file
from station.settings.recipe import check_recipes, recipe_files
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256
from station.settings.yaml_loader import parse_document

Command = Callable[..., Any]

_revision = click.option("--revision", metavar="N", type=click.IntRange(1), help="Which revision.")
_base = click.option(
    "--base", default="", metavar="HASH", help="The content hash, or 8 of its digits, of what the change is made to."
)


def _person(command: Command) -> Command:
    """Add the options of the person, role and reason, for the audit trail."""
    why = click.option("--reason", required=True, help="Why; for the audit trail.")
    role = click.option("--role", default="quality", show_default=True, help="In what capacity.")
    return click.option("--who", "--by", "who", required=True, metavar="NAME", help="Who does it.")(role(why(command)))


@click.group()
def recipes() -> None:
    """Manage recipes: their files, revisions and approvals."""


@recipes.command()
@click.argument("files", metavar="[FILE]...", nargs=-1, type=click.Path(path_type=Path))
@config_option
@click.pass_context
def check(context: click.Context, files: tuple[Path, ...], config: Path | None) -> None:
    """Check recipe files, and report all their errors.

    A FILE may be a folder. Without FILE the configured folder is checked, or else the shipped recipes.
    """
    if not files:
        files = tuple(recipe_files(load_configuration(config).recipes_folder))
    # Path.is_dir raises for names that are too long; a name that is none is the reader's to refuse.
    found = [path for file in files for path in (recipe_files(file) if os.path.isdir(file) else [file])]  # noqa: PTH112
    checked = check_recipes(dict.fromkeys(found))
    for path, recipe in checked.recipes.items():
        click.echo(f"OK {shortened_file(path)}: {_format_recipe(recipe)}")
    for problem in checked.problems:
        click.echo(str(problem), err=True)
    if checked.problems:
        context.exit(2)


@recipes.command("list")
@config_option
def list_all(config: Path | None) -> None:
    """List the recipes: the revision in force, the state of the file, and drafts that wait for approval."""
    store = _store(config)
    standings, problems = store.read()
    begun = bool(store.history())
    if not begun:
        click.echo("nothing is in force yet: the station's first start takes up what is here, or station recipes adopt")
    for standing in standings:
        click.echo(_line(standing))
        if standing.note and (begun or standing.file_state is not FileState.DRAFT):
            click.echo(f"    {standing.note}")
    for problem in problems:
        click.echo(problem, err=True)


@recipes.command()
@click.argument("name")
@_revision
@config_option
def show(name: str, revision: int | None, config: Path | None) -> None:
    """Show a recipe's file, or the text of one of its revisions, unchanged."""
    store = _store(config)
    click.echo(store.state(name).valid_file.text if revision is None else store.revision(name, revision).text, nl=False)


@recipes.command()
@click.argument("name")
@config_option
def history(name: str, config: Path | None) -> None:
    """Show a recipe's revisions: author, approver, retirement, times, reasons and changes."""
    store = _store(config)
    store.state(name)
    before: Revision | None = None
    for each in store.history(name):
        click.echo("\n".join(_format_revision(each, before)))
        before = each


@recipes.command()
@click.argument("name")
@click.option("--from", "old", metavar="N", type=click.IntRange(1), help="A revision. [default: the approved one]")
@click.option("--to", "new", metavar="N", type=click.IntRange(1), help="A revision. [default: the file]")
@config_option
def diff(name: str, old: int | None, new: int | None, config: Path | None) -> None:
    """Show every value that differs between two revisions, or between the approved one and the file."""
    store = _store(config)
    standing = store.state(name)
    if old is not None:
        before = store.revision(name, old).recipe
    elif standing.control is not None:
        before = standing.control.recipe
    else:
        raise BadInputError(f"recipe {name}: none of its revisions is approved; name one with --from")
    after = standing.valid_file.recipe if new is None else store.revision(name, new).recipe
    for difference in differences(before, after):
        click.echo(str(difference))


@recipes.command()
@config_option
def adopt(config: Path | None) -> None:
    """Start the history, as the station's first start does: existing recipes count as approved. Idempotent."""
    store = _store(config)
    store.begin({})
    for standing in store.read()[0]:
        click.echo(_line(standing))


@recipes.command()
@click.argument("name")
@click.option(
    "--set", "changes", metavar="PATH=VALUE", multiple=True, required=True, help="As damage.area[0].area_mm2=113."
)
@_base
@_person
@config_option
def edit(name: str, changes: tuple[str, ...], base: str, who: str, role: str, reason: str, config: Path | None) -> None:
    """Change values in a recipe's file; comments remain. The file is then an unapproved draft: submit it.

    With --base the change is refused if the file is another version, and the message lists the differences.
    """
    values = dict(_change(text) for text in changes)
    standing = _editor(config).edit(name, values, Person(who, role, reason), base)
    click.echo(_line(standing))


@recipes.command()
@click.argument("name")
@_person
@config_option
def submit(name: str, who: str, role: str, reason: str, config: Path | None) -> None:
    """Record a recipe's file as a draft, for another person to approve."""
    made = _store(config).submit(name, Person(who, role, reason))
    click.echo(f"{name} revision {made.revision} waits for another person's approval: {made.sha256[:12]}")


@recipes.command()
@click.argument("name")
@_revision
@_person
@config_option
def approve(name: str, revision: int | None, who: str, role: str, reason: str, config: Path | None) -> None:
    """Put a draft in force: the next lot is inspected by it. Its author cannot do this."""
    made = _store(config).approve(name, Person(who, role, reason), revision)
    click.echo(f"{name} revision {made.revision} is in force from the next lot on: {made.sha256[:12]}")


@recipes.command()
@click.argument("name")
@_revision
@_person
@config_option
def retire(name: str, revision: int | None, who: str, role: str, reason: str, config: Path | None) -> None:
    """Take a revision out of use, the approved one by default; a draft is rejected by this."""
    made = _store(config).retire(name, Person(who, role, reason), revision)
    click.echo(f"{name} revision {made.revision} is retired")


@recipes.command()
@click.argument("name")
@_revision
@_person
@config_option
def revert(name: str, revision: int | None, who: str, role: str, reason: str, config: Path | None) -> None:
    """Put the approved revision's text, or another's, back into the file; the present text is stored as a backup."""
    click.echo(_line(_editor(config).revert(name, Person(who, role, reason), revision)))


@recipes.command("export")
@click.argument("name")
@_revision
@click.option("--out", metavar="FILE", type=click.Path(path_type=Path), help="[default: standard output]")
@config_option
def export_one(name: str, revision: int | None, out: Path | None, config: Path | None) -> None:
    """Write a recipe with a first line that names its version, to edit it elsewhere and import it again."""
    text = _store(config).export_text(name, revision)
    if out is None:
        click.echo(text, nl=False)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInputError(f"--out {out}: cannot be written: {error.strerror}") from error


@recipes.command("import")
@click.argument("file", type=click.Path(path_type=Path))
@_base
@_person
@config_option
def import_one(file: Path, base: str, who: str, role: str, reason: str, config: Path | None) -> None:
    """Replace the recipe's file by FILE. It is then an unapproved draft: submit it.

    Refused where the recipe was changed since FILE was exported; the message lists the differences.
    """
    check = check_recipes([file])
    if check.problems:
        raise BadInputError("\n".join(map(str, check.problems)))
    text = file.read_text(encoding="utf-8-sig")
    click.echo(_line(_editor(config).import_text(text, Person(who, role, reason), base)))


@recipes.command()
@_person
@config_option
def upgrade(who: str, role: str, reason: str, config: Path | None) -> None:
    """Convert files of an earlier schema to this program's, comments included, with a backup. Idempotent."""
    done = _editor(config).upgrade(Person(who, role, reason))
    for path, version in done:
        click.echo(f"{path}: schema version {version} upgraded")
    click.echo(f"{len(done)} files were upgraded")


def _store(config: Path | None) -> RecipeStore:
    configuration = load_configuration(config)
    return RecipeStore(configuration.home, configuration.recipes_folder)


def _editor(config: Path | None) -> RecipeEditor:
    configuration = load_configuration(config)
    return RecipeEditor(configuration.home, configuration.recipes_folder)


def _change(text: str) -> tuple[str, Any]:
    path, equals, value = text.partition("=")
    if not equals:
        raise BadInputError(f"--set {shortened(text)}: expected PATH=VALUE")
    read = parse_document(value.strip().encode(), f"--set {shortened(text)}")
    if read.problems:
        raise SettingsError(read.problems)
    return path.strip(), read.value


def _line(standing: RecipeState) -> str:
    """Format a recipe's state in one line."""
    control = standing.control
    force = "not in force" if control is None else f"revision {control.revision} in force"
    known = standing.recipe
    what = "" if known is None else f", PLC number {known.plc_number}, {content_sha256(known)[:12]}"
    waits = (
        ""
        if standing.submitted is None
        else (f"; revision {standing.submitted.revision} of {standing.submitted.author} waits for approval")
    )
    return f"{standing.name}: {force}{what}; file: {standing.file_state}{waits}"


def _format_revision(each: Revision, before: Revision | None) -> list[str]:
    """Format a revision in some lines."""
    lines = [f"{each.name} revision {each.revision}: {each.status}, {each.origin}, {each.sha256[:12]}"]
    lines.append(f"    by {each.author} at {formatted(each.created_utc_ms)}: {each.reason}")
    if each.approved_utc_ms is not None:
        by = each.approver or each.author
        lines.append(f"    approved by {by} at {formatted(each.approved_utc_ms)}: {each.approval_reason}")
    if each.status is Status.RETIRED and each.retired_utc_ms is not None:
        lines.append(f"    retired by {each.retired_by} at {formatted(each.retired_utc_ms)}: {each.retired_reason}")
    if before is not None:
        try:
            lines += [f"    {difference}" for difference in differences(before.recipe, each.recipe)]
        except SettingsError as error:  # one of them is not accepted any more
            lines += [f"    {line}" for line in str(error).splitlines()]
    return lines


def _format_recipe(recipe: Recipe) -> str:
    """Format a recipe in one line."""
    steps = recipe.steps
    closings = ", ".join(f"{closing_mm:g}" for closing_mm in steps.result_closings_mm)
    return (
        f"{recipe.name}, PLC number {recipe.plc_number}, "
        f"{recipe.expected_width.smallest_mm:g} to {recipe.expected_width.largest_mm:g} mm wide, "
        f"{steps.number} steps of {steps.step_mm:g} mm, results at {closings} mm, {recipe.segmentation.method}"
    )
