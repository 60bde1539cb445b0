"""Fit the twin's DIGIT on real images and write the numbers: `python -m benchmarks.twin.fit PRESSES BACKGROUNDS`.

PRESSES holds `reference.jpg`, presses of a ball of 6 mm diameter, and `contacts.csv` with the contact's edge in
each; BACKGROUNDS holds no-contact images of many units. Nothing but fitted numbers is written.
"""

import csv
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.errors import BadInputError
from station.twin.digit import numbers
from station.twin.digit.backgrounds import COSINES, FLOOR, cosine_basis
from station.twin.digit.noise import Drift, FrameNoise
from station.twin.digit.numbers import FILE, NoiseLevels
from station.twin.digit.optics import DIRECTIONS, PLACES, SLOPE_KNOTS, grid_places, slope_basis, slopes
from station.twin.gel import (
    GRID_SHAPE,
    GRID_STEP,
    MM_PER_PX,
    SENSOR_SHAPE,
    FloatArray,
    Gel,
    Surface,
    dent_mm,
    visible_edge_mm,
)

from .statistics import NoiseStatistics, measure_noise

BALL_RADIUS_MM = 3.0
SMOOTHING_MM = 0.1
_RIDGE = 30.0
_RING_RIDGE = 300.0
_FIT_REACH = 2.2
_FREE_REACH = 2.2
_MODES = 8
_CALIBRATIONS = 3
_CALIBRATION_FRAMES = 200
_OFFSET_STEPS = 3000
_OFFSET = 3
"""The offset's place among the levels."""
PRESS_GAP_S = 10.0
"""Time from one real press to the next: not recorded, so taken."""


class Press(NamedTuple):
    """One real press: its image and the annotated contact edge."""

    name: str
    image: npt.NDArray[np.uint8]
    x_px: float
    y_px: float
    radius_px: float


def read_presses(folder: Path) -> tuple[npt.NDArray[np.uint8], list[Press]]:
    """Read the reference and the presses.

    Args:
        folder: with `reference.jpg`, the presses and `contacts.csv`.

    Raises:
        BadInputError: a file is missing or is not what it has to be.
    """
    table = folder / "contacts.csv"
    try:
        with table.open(encoding="utf-8", newline="") as file:
            presses = [
                Press(
                    row["image"],
                    _read_image(folder / row["image"]),
                    *(float(row[key]) for key in ("centre_x_px", "centre_y_px", "radius_px")),
                )
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, ValueError) as error:
        raise BadInputError(f"{table}: expected columns image, centre_x_px, centre_y_px, radius_px: {error}") from error
    return _read_image(folder / "reference.jpg"), presses


def _read_image(path: Path, shape: tuple[int, int] = SENSOR_SHAPE) -> npt.NDArray[np.uint8]:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None or image.shape[:2] != shape:
        raise BadInputError(f"{path}: expected a portrait image of {shape[1]}x{shape[0]} pixels")
    return np.asarray(image, np.uint8)


def ball_dent(press: Press, gel: Gel) -> FloatArray:
    """The dent of the ball whose visible edge is where it was annotated, shape (320, 240), mm.

    Args:
        press: the annotation.
        gel: the gel.
    """
    edge_mm = press.radius_px * MM_PER_PX
    contact_mm = edge_mm
    for _ in range(20):
        contact_mm -= 0.5 * (visible_edge_mm(contact_mm, contact_mm / BALL_RADIUS_MM) - edge_mm)
    rows, columns = np.indices(GRID_SHAPE, dtype=np.float32)
    centre = (GRID_STEP - 1) / 2
    x_mm = (columns * GRID_STEP + centre - press.x_px) * MM_PER_PX
    y_mm = (rows * GRID_STEP + centre - press.y_px) * MM_PER_PX
    approach_mm = 2.0 * (BALL_RADIUS_MM - float(np.sqrt(BALL_RADIUS_MM**2 - contact_mm**2)))
    ball = Surface(BALL_RADIUS_MM, BALL_RADIUS_MM)
    gap = ball.gap_mm(((np.square(x_mm) + np.square(y_mm)) / BALL_RADIUS_MM**2).astype(np.float32))
    return dent_mm(gap, approach_mm, ball, gel)


def fit_table(reference: npt.NDArray[np.uint8], presses: Sequence[Press]) -> FloatArray:
    """Fit the optical table by least squares with a ridge and smooth rings.

    Args:
        reference: shape (640, 480, 3).
        presses: the presses to fit on.

    Returns:
        Shape (knots - 1, directions, places, 3), grey levels.
    """
    rings = len(SLOPE_KNOTS) - 1
    count = rings * DIRECTIONS * PLACES
    normal, right = np.zeros((count, count)), np.zeros((count, 3))
    places, gel = grid_places(), Gel()
    rows, columns = np.indices(GRID_SHAPE)
    chequered = (rows + columns) % 2 == 0
    for press in presses:
        difference = press.image.astype(np.float32) - reference
        change = cv2.resize(difference, GRID_SHAPE[::-1], interpolation=cv2.INTER_AREA)
        distance = np.hypot(columns * GRID_STEP - press.x_px, rows * GRID_STEP - press.y_px)
        change -= np.median(change[distance > _FREE_REACH * press.radius_px], axis=0)
        used = (distance < _FIT_REACH * press.radius_px) & chequered
        slope_x, slope_y = slopes(ball_dent(press, gel), SMOOTHING_MM)
        basis = slope_basis(slope_x[used], slope_y[used]).reshape(rings * DIRECTIONS, -1)
        features = (basis[:, None] * places[:, used]).reshape(count, -1)
        normal += features @ features.T
        right += features @ change[used]
    steps = np.diff(np.eye(rings), axis=0)
    smooth = np.kron(steps.T @ steps, np.eye(DIRECTIONS * PLACES))
    weights = np.linalg.solve(normal + _RIDGE * np.eye(count) + _RING_RIDGE * smooth, right)
    return weights.reshape(rings, DIRECTIONS, PLACES, 3).astype(np.float32)


def fit_backgrounds(images: Sequence[npt.NDArray[np.uint8]]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The mean, the principal variations and each image's part in them, in cosine coefficients of the logarithm.

    Args:
        images: no-contact images of any size, the fitted unit's last.

    Returns:
        Mean (3, rows, columns), modes (modes, 3, rows, columns) one standard deviation each, and the last
        image's weights (modes,).
    """
    fields = np.stack([_cosines(image) for image in images])
    mean = fields.mean(axis=0)
    flat = (fields - mean).reshape(len(images), -1)
    parts, sizes, modes = np.linalg.svd(flat, full_matrices=False)
    scale = sizes[:_MODES] / np.sqrt(len(images) - 1)
    weights = parts[-1, :_MODES] * np.sqrt(len(images) - 1)
    return mean, (modes[:_MODES] * scale[:, None]).reshape(_MODES, *mean.shape), weights


def _cosines(image: npt.NDArray[np.uint8]) -> FloatArray:
    logarithm = np.log(cv2.GaussianBlur(image, (0, 0), image.shape[1] / 120).astype(np.float32) + FLOOR)
    rows, columns = image.shape[:2]
    down, along = cosine_basis(rows, COSINES[0]) / rows, cosine_basis(columns, COSINES[1]) / columns
    return np.stack([down.T @ logarithm[..., channel] @ along for channel in range(3)]).astype(np.float32)


def free_of_contact(press: Press) -> npt.NDArray[np.bool_]:
    """Return a mask of the sensor's shape, True where the press cannot be seen.

    Args:
        press: the annotation.
    """
    rows, columns = np.indices(SENSOR_SHAPE)
    return np.hypot(columns - press.x_px, rows - press.y_px) > _FREE_REACH * press.radius_px


def fit_noise(presses: Sequence[Press]) -> NoiseLevels:
    """The levels at which the twin's frames, measured by the same ruler, have the real frames' statistics.

    Args:
        presses: in the order in which they were taken.
    """
    wanted = _strengths(measure_noise([press.image for press in presses], [free_of_contact(one) for one in presses]))
    levels = wanted / np.sqrt(2.0)
    free = np.ones(SENSOR_SHAPE, np.bool_)
    for _ in range(_CALIBRATIONS):
        tried = NoiseLevels(*levels.astype(np.float32))
        frames = noisy_frames(tried, _CALIBRATION_FRAMES)
        found = _strengths(measure_noise(frames, [free] * len(frames)))
        found[_OFFSET] = _offset_strength(tried)
        levels = levels * wanted / found
    return NoiseLevels(*levels.astype(np.float32))


def _offset_strength(levels: NoiseLevels) -> npt.NDArray[np.float64]:
    """The offsets' strength over so many steps that the rare large ones count for what they are; shape (3,)."""
    drift = Drift(levels, seed=1)
    offsets = []
    for index in range(_OFFSET_STEPS):
        drift.advance(index * PRESS_GAP_S)
        offsets.append(drift.field[::8, ::8].mean(axis=(0, 1)))
    median, p95 = np.percentile(np.abs(np.diff(offsets, axis=0)), [50, 95], axis=0)
    return np.sqrt(median * p95)


def noisy_frames(levels: NoiseLevels, count: int, seed: int = 0) -> list[npt.NDArray[np.uint8]]:
    """Frames of a grey field with the twin's noise, as far apart in time as the real presses are taken to be.

    Args:
        levels: the noise's levels.
        count: how many.
        seed: of the noise.
    """
    noise, drift = FrameNoise(levels, seed), Drift(levels, seed)
    frames = []
    for index in range(count):
        drift.advance(index * PRESS_GAP_S)
        field = 128.0 + drift.field + noise.columns() + noise.rows() + noise.pixels()
        frames.append(np.clip(np.rint(field), 0, 255).astype(np.uint8))
    return frames


def _strengths(found: NoiseStatistics) -> npt.NDArray[np.float64]:
    """One strength for each level, in the order of `NoiseLevels`; shape (6, 3)."""
    along = np.sqrt(np.maximum(0.01, found.column**2 - found.column_fine**2))
    down = np.sqrt(np.maximum(0.01, found.row**2 - found.row_fine**2))
    offset = np.sqrt(found.offset_median * found.offset_p95)
    return np.stack([found.pixel, found.column_fine, found.row_fine, offset, along, down]).astype(np.float64)


def main(arguments: Sequence[str]) -> int:
    """Fit on two folders and write the file of the twin's sensor.

    Args:
        arguments: the folder of presses and the folder of backgrounds.
    """
    if len(arguments) != 2:
        print("usage: python -m benchmarks.twin.fit PRESSES BACKGROUNDS", file=sys.stderr)
        return 2
    reference, presses = read_presses(Path(arguments[0]))
    paths = sorted(Path(arguments[1]).glob("*.jpg"))
    backgrounds = [_read_image(path, (320, 240)) for path in paths]
    mean, modes, weights = fit_backgrounds([*backgrounds, reference])
    target = Path(numbers.__file__).with_name(FILE)
    np.savez_compressed(
        target,
        table=fit_table(reference, presses).astype(np.float32),
        smoothing_mm=np.float32(SMOOTHING_MM),
        background_mean=mean.astype(np.float16),
        background_modes=modes.astype(np.float16),
        background_fitted=weights.astype(np.float32),
        **dict[str, Any]({f"noise_{name}": level for name, level in asdict(fit_noise(presses)).items()}),
    )
    print(f"{target}: fitted on {len(presses)} presses and {len(backgrounds)} backgrounds")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
