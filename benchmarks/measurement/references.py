"""References that do not belong to the frame: another unit's, and a gel whose specks have moved since."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from measurement import soft_bodies
from station.settings.segmentation import RobustParameters
from station.vision.contact import Contact, Image
from station.vision.median import median_image
from station.vision.robust import RobustMethod
from station.vision.step import measure_step
from station.vocabulary import Flag

TWIN_SEEDS = range(101_000, 101_100)
"""Nothing was chosen on them."""


def reference_table(folder: Path) -> list[str]:
    """Return a table of frames flagged, found and judged against a reference that does not belong to them."""
    rows: list[tuple[str, list[Contact]]] = []
    paths = sorted((folder / "digit_backgrounds").glob("*.jpg"))
    units = [np.asarray(cv2.imread(str(path)), np.uint8) for path in paths]
    methods = [RobustMethod(unit, RobustParameters()) for unit in units]
    pairs = [methods[a].measure(units[b]) for a in range(len(units)) for b in range(len(units)) if a != b]
    rows.append(("real, another unit's reference, untouched", pairs))
    own = [method.measure(unit) for method, unit in zip(methods, units, strict=True)]
    rows.append(("real, its own reference, untouched", own))
    other = soft_bodies.other_unit_pairs(TWIN_SEEDS)
    rows.append(("twin, another unit's reference, untouched", _measured(other)))
    pressed: list[Contact] = []
    for seed in TWIN_SEEDS[:17]:
        for press in soft_bodies.soft_presses([seed], frames_per_step=1, steps=4):
            mixed = soft_bodies.press_with_other_reference(press)
            method = RobustMethod(median_image(mixed.references), RobustParameters())
            pressed.append(method.measure(mixed.steps[-1].frames[0]))
    rows.append(("twin, another unit's reference, pressed", pressed))
    rows.append(("twin, specks moved since the reference, untouched", _measured(soft_bodies.moved_specks(TWIN_SEEDS))))
    lines = ["| frames | pairs | flagged as another unit's | with an area | judged |", "|---|---|---|---|---|"]
    for name, contacts in rows:
        flagged = sum(Flag.REFERENCE_MISMATCH in one.flags for one in contacts)
        judged = sum(one.found and not one.flags & {Flag.LOW_CONFIDENCE, Flag.UNDECIDED} for one in contacts)
        lines.append(f"| {name} | {len(contacts)} | {flagged} | {sum(one.found for one in contacts)} | {judged} |")
    return lines


def _measured(pairs: Iterable[soft_bodies.Untouched]) -> list[Contact]:
    return [
        measure_step(RobustMethod(median_image(pair.references), RobustParameters()), pair.frames) for pair in pairs
    ]


def compressed(images: Sequence[Image], how: str) -> list[Image]:
    """Images as compression leaves them.

    Args:
        images: of one shape.
        how: `none`, `JPEG` with its quality, or `video`.
    """
    if how == "none":
        return list(images)
    if how == "video":
        return soft_bodies.with_video(images)
    return soft_bodies.with_jpeg(images, int(how.split()[1]))
