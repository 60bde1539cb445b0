"""Noise statistics of a series of frames; the same for real frames and for the twin's."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.twin.gel import FloatArray

_FINE_PX = 15.0


@dataclass(frozen=True, slots=True)
class NoiseStatistics:
    """Grey levels of the change from one frame to the next, outside the contacts; each of shape (3,), B, G, R."""

    pixel: FloatArray
    """Standard deviation of a pixel in one frame: the change's over the root of two."""
    column: FloatArray
    """Standard deviation of the columns' means."""
    column_fine: FloatArray
    """The same without what is wider than about 30 px."""
    row: FloatArray
    row_fine: FloatArray
    offset_median: FloatArray
    """Median size of the whole frame's change."""
    offset_p95: FloatArray


def measure_noise(frames: Sequence[npt.NDArray[np.uint8]], outside: Sequence[npt.NDArray[np.bool_]]) -> NoiseStatistics:
    """Measure the noise between neighbouring frames.

    Args:
        frames: each of shape (rows, columns, 3), dtype uint8, at least two.
        outside: for each frame where nothing touches, shape (rows, columns).
    """
    found: list[FloatArray] = []
    offsets: list[FloatArray] = []
    for before, after, free_before, free_after in zip(frames, frames[1:], outside, outside[1:], strict=False):
        free = (free_before & free_after)[..., None].astype(np.float32)
        change = (after.astype(np.float32) - before) * free
        offsets.append(change.sum(axis=(0, 1)) / free.sum())
        column = change.sum(axis=0) / np.maximum(1.0, free.sum(axis=0))
        rest = (change - column) * free
        row = rest.sum(axis=1) / np.maximum(1.0, free.sum(axis=1))
        rest = (rest - row[:, None]) * free
        pixel = np.sqrt(np.square(rest).sum(axis=(0, 1)) / free.sum() / 2.0)
        found.append(np.stack([pixel, column.std(0), _fine(column), row.std(0), _fine(row)]))
    pixel, column, column_fine, row, row_fine = np.median(np.stack(found), axis=0)
    sizes = np.abs(np.stack(offsets))
    median, p95 = np.percentile(sizes, [50, 95], axis=0)
    return NoiseStatistics(pixel, column, column_fine, row, row_fine, median, p95)


def _fine(line: FloatArray) -> FloatArray:
    """Standard deviation of a line's means without its slow part, per channel."""
    slow = cv2.GaussianBlur(line[None], (0, 0), _FINE_PX, sigmaY=1e-3)[0]
    return (line - slow).std(axis=0)
