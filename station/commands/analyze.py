"""`station analyze`: measure the deformed area in tactile images."""

import os
import sys
from functools import partial
from pathlib import Path

import click
import cv2

from station.analysis.analysis import Request, analyze
from station.analysis.sources import list_sources, load_references
from station.analysis.widths import read_widths
from station.calibration.errors import UnknownCalibrationError
from station.calibration.model import Calibration
from station.calibration.store import CalibrationStore
from station.errors import BadInputError
from station.settings.configuration import load_configuration
from station.settings.recipe import find_recipe
from station.settings.segmentation import Segmentation

PLACE = click.Path(path_type=Path, readable=False)


@click.command("analyze")
@click.option("--reference", required=True, type=PLACE, help="Image of the untouched gel, or a folder or video of it.")
@click.option("--recipe", "recipe_name", metavar="NAME", help="Recipe, by name or file, whose segmentation is used.")
@click.option("--method", type=click.Choice(["paper", "robust"]), help="Method, in place of the recipe's.")
@click.option(
    "--widths", type=PLACE, help="CSV image,width_mm: the images are steps of presses; adds closing and area curves."
)
@click.option("--sequence", is_flag=True, help="The images are the steps of one press, in the order given.")
@click.option("--unit", metavar="SERIAL", help="The sensor that took the images, whose calibration gives the scale.")
@click.option("--stages", is_flag=True, help="Write each stage's picture as well.")
@click.option(
    "--jobs",
    type=click.IntRange(1, 64),
    default=lambda: min(64, os.cpu_count() or 1),
    show_default="one a core",
    help="Images measured at the same time; those of one press are measured one after the other.",
)
@click.option("--out", required=True, type=PLACE, help="Folder for the results; it must not hold an earlier one.")
@click.argument("images", nargs=-1, required=True, type=PLACE, metavar="IMAGE...")
def analyze_command(
    reference: Path,
    recipe_name: str | None,
    method: str | None,
    widths: Path | None,
    unit: str | None,
    sequence: bool,  # noqa: FBT001 (click passes arguments by name)
    stages: bool,  # noqa: FBT001
    jobs: int,
    out: Path,
    images: tuple[Path, ...],
) -> None:
    """Measure the deformed area in tactile images: files, folders or videos.

    Writes results.csv, masks/, contact_sheet.png and report.html into the folder given with --out. An image that
    cannot be measured is listed in errors.csv; the others' results are written, and the exit code is 2.

    A video, and images with --widths or --sequence, are steps of a press: each is measured with the step before.
    Each video and each folder is a press of its own. Other images are measured each by itself.
    """
    cv2.setNumThreads(1)  # so that --jobs says how many cores are used
    site = load_configuration()
    recipe = find_recipe(recipe_name, site.recipes_folder) if recipe_name is not None else None
    segmentation = recipe.segmentation if recipe else Segmentation()
    if method:
        segmentation = segmentation.model_copy(update={"method": method})
    calibration = _calibration(site.home, unit) if unit is not None else None
    references = load_references(reference)
    for conversion in sorted({text for decoded in references for text in decoded.conversions}):
        click.echo(f"station: reference converted: {conversion}", err=True)
    listing = list_sources(images, reference)
    if listing.passed_over:
        names = ", ".join(path.name for path in listing.passed_over[:5])
        click.echo(f"station: not measured: {names}{', …' if len(listing.passed_over) > 5 else ''}", err=True)
    request = Request(
        sources=listing.sources,
        references=references,
        reference_name=str(reference),
        segmentation=segmentation,
        recipe=recipe.name if recipe else None,
        widths_mm=read_widths(widths) if widths else None,
        out=out,
        stages=stages,
        jobs=jobs,
        calibration=calibration,
        sequence=sequence,
        site_mm_per_px=site.camera.mm_per_px,
    )
    with click.progressbar(
        length=len(listing.sources), label="measuring", file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:
        outcome = analyze(request, partial(bar.update, 1))
    for item in outcome.refused:
        click.echo(f"station: {item.reason}", err=True)
    if request.widths_mm is not None and outcome.measured and not outcome.touched:
        click.echo("station: no image shows more than a light touch, so there is no onset and no area curve", err=True)
    if outcome.measured:
        click.echo(f"{outcome.measured} images measured; report: {out / 'report.html'}")
    if outcome.refused:
        raise BadInputError(f"{len(outcome.refused)} of {len(listing.sources)} images could not be measured")


def _calibration(home: Path, serial: str) -> Calibration:
    store = CalibrationStore(home)
    calibrations = store.calibrations(serial)  # also of an earlier gel: the images may be of it
    if not calibrations:
        known = ", ".join(store.serials()) or "none yet"
        raise UnknownCalibrationError(f"--unit {serial}: it has no calibration in {home}; calibrated are: {known}")
    return calibrations[0]
