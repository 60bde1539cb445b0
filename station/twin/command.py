"""`station twin`: the simulated world from the command line."""

import csv
from io import StringIO
from pathlib import Path

import click
import cv2
import numpy as np
import numpy.typing as npt

from station.errors import BadInputError
from station.twin.digit.press import render_press
from station.twin.fruit import Kind

FRUIT = click.Choice([kind.value for kind in Kind])
_OPEN_STEPS = 2


@click.group("twin")
def twin() -> None:
    """Run the simulated world, or draw from it."""


@twin.command("press")
@click.option("--fruit", type=FRUIT, default=Kind.STRAWBERRY.value, show_default=True, help="What is pressed.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=1, show_default=True, help="Which fruit, and noise.")
@click.option("--steps", type=click.IntRange(1, 40), default=12, show_default=True, help="Images after first contact.")
@click.option("--step-mm", type=click.FloatRange(0.1, 5), default=1.0, show_default=True, help="Closing per image.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the images; must not exist.")
def press(fruit: str, seed: int, steps: int, step_mm: float, out: Path) -> None:
    """Press a fruit without a gripper: images, widths and true masks, as `station analyze` reads them.

    Writes reference/, frames/, truth/ and widths.csv. The first two images show the gel untouched.
    """
    try:
        for name in ("reference", "frames", "truth"):
            (out / name).mkdir(parents=True)
    except OSError as error:
        raise BadInputError(f"{out}: cannot be made: {error.strerror}; name a new folder") from error
    closings_mm = [step_mm * (step + 1 - _OPEN_STEPS) for step in range(steps + _OPEN_STEPS)]
    sequence = render_press(fruit, seed, closings_mm)
    for number, image in enumerate(sequence.references):
        _write(out / "reference" / f"reference_{number}.png", image)
    table = StringIO(newline="")
    writer = csv.writer(table)
    writer.writerow(("image", "width_mm"))
    for number, (image, mask, width_mm) in enumerate(
        zip(sequence.frames, sequence.true_masks, sequence.widths_mm, strict=True)
    ):
        name = f"step_{number:02d}.png"
        _write(out / "frames" / name, image)
        _write(out / "truth" / name, mask)
        writer.writerow((name, f"{width_mm:.2f}"))
    (out / "widths.csv").write_bytes(table.getvalue().encode())
    click.echo(f"{len(sequence.frames)} images of a {fruit} in {out}")


def _write(path: Path, picture: npt.NDArray[np.uint8]) -> None:
    path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
