"""Data sets of the robust method's fit: presses at the working size with their truth, rendered once and cached.

The method works on images of at most 320 pixels a side whatever it is given, so a data set holds images of that size:
the areas are the same within rounding, and a whole data set is measured in seconds.
"""

import csv
import hashlib
import os
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from measurement import on_the_twin
from station.twin.fruit import draw_fruit
from station.vision.contact import Image
from station.vision.step import mean_image
from station.vision.working import working_image

ROOT = Path(__file__).resolve().parents[2]


class PressData(NamedTuple):
    """One press, or one image with nothing before it."""

    group: str
    """What the press shows, for the tables' rows."""
    references: list[Image]
    """Frames with nothing touching, each of shape (height, width, 3), dtype uint8, at the working size."""
    images: list[Image]
    """The mean image of each step, in order of rising compression."""
    truths: list[npt.NDArray[np.bool_]]
    """Where the body touches the gel at each step, shape (height, width)."""


DataSet = list[PressData]


def real_presses(folder: Path) -> DataSet:
    """The real presses of a ball, each a press of one step."""
    reference = working_image(read(folder / "reference.jpg"))
    found: DataSet = []
    for row in csv.DictReader((folder / "contacts.csv").read_text().splitlines()):
        image = read(folder / row["image"])
        y, x = np.mgrid[: image.shape[0], : image.shape[1]]
        away = np.hypot(x - float(row["centre_x_px"]), y - float(row["centre_y_px"]))
        truth = (away <= float(row["radius_px"])).astype(np.uint8) * 255
        found.append(PressData("real ball", [reference], [working_image(image)], [small(truth)]))
    return found


def small(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """A mask at the working size."""
    height, width = mask.shape
    shrink = min(1.0, 320 / max(height, width))
    size = (round(width * shrink), round(height * shrink))
    return cv2.resize(mask, size, interpolation=cv2.INTER_AREA) > 127


def read(path: Path) -> Image:
    """An image that has to be there."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SystemExit(f"{path}: cannot be read; name the folder of real images with --images")
    return np.asarray(image, np.uint8)


def fruit_presses(seed: int, *, bruised: bool) -> DataSet:
    """Sound or bruised fruit of the twin in seven conditions, three frames a step and five of the reference."""
    kinds = on_the_twin.BRUISED_FRUITS if bruised else on_the_twin.FRUITS
    found: DataSet = []
    for kind in kinds:
        for number, (name, options) in enumerate(on_the_twin.conditions().items()):
            fruit = draw_fruit(kind, seed + number, bruised=bruised)
            press = on_the_twin.squeezed_with_masks(fruit, seed + number, options)
            found.append(PressData(f"{kind}, {name}", *press))
    return found


def soft_presses(seeds: Sequence[int]) -> DataSet:
    """Soft bodies of the twin, from before the first touch to filling the field."""
    from measurement import soft_bodies  # noqa: PLC0415 (imports the whole twin; most callers need no soft body)

    found: DataSet = []
    for press in soft_bodies.soft_presses(seeds):
        images = [working_image(mean_image(step.frames)) for step in press.steps]
        # A ring's flat middle is measured with it, as a ball's is: one image does not tell which of them it is.
        truths = [small(filled(np.asarray(step.true_mask, np.uint8))) for step in press.steps]
        found.append(PressData(press.kind, [working_image(one) for one in press.references], images, truths))
    return found


def filled(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """A mask with its holes filled."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(mask), outlines, -1, 255, cv2.FILLED), np.uint8)


def cached(name: str, make: Callable[[], DataSet], folder: Path, version: str) -> DataSet:
    """A data set from the cache's folder, or made and stored there; the version is part of the file's name."""
    path = folder / f"{name}-{hashlib.sha256(version.encode()).hexdigest()[:12]}.pickle"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        beside = path.with_suffix(f".{os.getpid()}")  # another run may make the same
        beside.write_bytes(pickle.dumps(make(), protocol=5))
        beside.replace(path)
    data: DataSet = pickle.loads(path.read_bytes())
    return data


def in_processes(parts: Sequence[Callable[[], DataSet]]) -> DataSet:
    """Several parts made at the same time, in their order."""
    with ProcessPoolExecutor(2) as pool:
        return [press for part in pool.map(_call, parts) for press in part]


def _call(part: Callable[[], DataSet]) -> DataSet:
    return part()
