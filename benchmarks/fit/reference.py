"""Reference check: its statistic on units against themselves and against others, the origin of its thresholds."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from measurement import soft_bodies
from measurement.data_sets import read

from fit.parts import Group, Groups
from fit.progress import report
from fit.reliability import PERTURBATIONS, perturbed
from station.twin.digit.sensor import Condition, DigitSensor
from station.vision.contact import FloatImage, Image
from station.vision.median import median_image
from station.vision.reference_check import ReferenceCheck
from station.vision.working import clipped, resized, working_image

TWIN_PAIRS = range(91_000, 91_100)
"""Seeds of the pairs on which the thresholds were chosen."""
FOGGED_UNITS = (None, *range(900, 924))
FOGS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
_FOGGED_AFTER_S = 8.0
_FRAMES_PER_S = 30.0

Frames = Iterable[tuple[Sequence[Image], Image]]
"""References, and a frame that is compared with them."""


def reference_table(parts: Sequence[Groups], images: Path) -> list[str]:
    """The statistic over its threshold for frames of a unit against itself, and against another.

    Args:
        parts: the data sets.
        images: the folder of real images.
    """
    followed = [group for groups in parts for group in groups.values() if group.followed]
    backgrounds = [read(path) for path in sorted((images / "digit_backgrounds").glob("*.jpg"))]
    pairs = [([one], other) for one in backgrounds for other in backgrounds if other is not one]
    others = ((pair.references, pair.frames[0]) for pair in soft_bodies.other_unit_pairs(TWIN_PAIRS))
    light, others_changed = [], []
    for group, one in zip(perturbed(images / "digit_presses").values(), PERTURBATIONS, strict=True):
        (others_changed if one.on_reference else light).append(group)
    rows: list[tuple[str, bool, Frames]] = [
        (
            f"real presses under {len(others_changed)} perturbations of frame and reference",
            True,
            _presses(others_changed),
        ),
        ("real presses, the frame alone a fifth darker or brighter", True, _presses(light)),
        ("the twin's presses of the fit's both parts", True, _presses(followed)),
        ("the twin with a lens fogged by a tenth to wholly", True, _fogged()),
        ("real, another unit's", False, pairs),
        ("the twin, another unit's", False, others),
    ]
    lines = ["| frames | number | median | largest, or least of others' | flagged |", "|---|---|---|---|---|"]
    for name, own, frames in rows:
        found = np.array([_statistic(references, frame) for references, frame in frames])
        extreme = found.max() if own else found.min()
        lines.append(
            f"| {name} | {len(found)} | {np.median(found):.2f} | {extreme:.2f} | {np.count_nonzero(found > 1)} |"
        )
        report(f"reference check: {name}")
    return lines


def _presses(groups: Iterable[Group]) -> Frames:
    for group in groups:
        for press in group.presses:
            yield from ((press.references, image) for image in press.images)


def _fogged() -> Frames:
    for unit in FOGGED_UNITS:
        sensor = DigitSensor(1, unit)
        references = [sensor.frame(None, number / _FRAMES_PER_S) for number in range(5)]
        for fog in FOGS:
            yield references, sensor.frame(None, _FOGGED_AFTER_S, Condition(fog=fog))


def _statistic(references: Sequence[Image], frame: Image) -> float:
    return ReferenceCheck(_half(median_image(list(references)))).mismatch(_half(frame))


def _half(image: Image) -> FloatImage:
    """As the robust method has it: cut off where it saturates, at half the working size."""
    light = clipped(working_image(image))
    height, width = light.shape[:2]
    return resized(np.asarray(light, np.float32), (-(-width // 2), -(-height // 2)))
