"""`station recipes`: look after recipe files."""

import os
from pathlib import Path

import click

from station.settings.configuration import load_configuration
from station.settings.problems import shortened
from station.settings.recipe import Recipe, check_recipes, recipe_files


@click.group()
def recipes() -> None:
    """Check recipe files."""


@recipes.command()
@click.argument("files", metavar="[FILE]...", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The configuration that names the recipe folder. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)
@click.pass_context
def check(context: click.Context, files: tuple[Path, ...], config: Path | None) -> None:
    """Check recipe files, and say all that is wrong with them.

    A FILE may be a folder. Without FILE the configured folder is checked, or else the recipes shipped.
    """
    if not files:
        files = tuple(recipe_files(load_configuration(config).recipes_folder))
    # Path.is_dir raises for names that are too long; a name that is none is the reader's to refuse.
    found = [path for file in files for path in (recipe_files(file) if os.path.isdir(file) else [file])]  # noqa: PTH112
    checked = check_recipes(dict.fromkeys(found))
    for path, recipe in checked.recipes.items():
        click.echo(f"OK {shortened(str(path), 1000)}: {_facts(recipe)}")
    for problem in checked.problems:
        click.echo(str(problem), err=True)
    if checked.problems:
        context.exit(2)


def _facts(recipe: Recipe) -> str:
    """A recipe in one line."""
    steps = recipe.steps
    closings = ", ".join(f"{closing_mm:g}" for closing_mm in steps.result_closings_mm)
    return (
        f"{recipe.name}, PLC number {recipe.plc_number}, "
        f"{recipe.expected_width.smallest_mm:g} to {recipe.expected_width.largest_mm:g} mm wide, "
        f"{steps.number} steps of {steps.step_mm:g} mm, results at {closings} mm, {recipe.segmentation.method}"
    )
