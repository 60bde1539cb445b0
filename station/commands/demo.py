"""`station demo`: the way from tactile images to a report, on a press that the twin draws."""

import itertools
import subprocess
import sys
from datetime import UTC, datetime

import click

from station.commands.analyze import analyze_command
from station.errors import StationError
from station.settings.configuration import load_configuration
from station.settings.recipe import recipe_files

# The fruit whose contacts the method finds best (docs/measurement.md), in steps that the eye can follow.
_FRUIT = "blueberry"
_STEPS = 8
_STEP_MM = 1.0
_DRAWING_TIMEOUT_S = 120


@click.command("demo")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=1, show_default=True, help="Which fruit.")
@click.pass_context
def demo(context: click.Context, seed: int) -> None:
    """Press a simulated blueberry, measure the images, and say where the report lies.

    The press has two images of the untouched gel and eight of the contact, 1 mm of closing apart. They are measured
    with the blueberry's recipe, by the robust method.
    """
    folder = load_configuration().home / "demo" / datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%S-%f")
    drawn = folder / "press"
    click.echo(f"drawing a press of a simulated {_FRUIT} into {drawn}")
    options = {"--fruit": _FRUIT, "--seed": seed, "--steps": _STEPS, "--step-mm": _STEP_MM, "--out": drawn}
    command = (sys.executable, "-m", "station", "twin", "press", *itertools.chain(*options.items()))
    try:
        done = subprocess.run(  # noqa: S603 (this program itself)
            [str(part) for part in command], timeout=_DRAWING_TIMEOUT_S, check=False, stdout=sys.stderr
        )
    except subprocess.TimeoutExpired as error:
        raise StationError(
            f"the twin took more than {_DRAWING_TIMEOUT_S:g} s to draw the press; "
            "end what else keeps this machine busy and start the demonstration again"
        ) from error
    if done.returncode:
        raise StationError("the twin could not draw the press: see its message above")
    shipped = next(file for file in recipe_files() if file.stem == _FRUIT)  # whatever recipes the site has
    context.invoke(
        analyze_command,
        reference=drawn / "reference",
        recipe_name=str(shipped),
        widths=drawn / "widths.csv",
        stages=True,
        out=folder / "report",
        images=(drawn / "frames",),
    )
    click.echo(f"the report opens in a browser: {(folder / 'report' / 'report.html').as_uri()}")
