"""Frame check: faults of a frame, found from its pixels, its time and the frame before."""

import cv2
import numpy as np
import numpy.typing as npt

from station.devices.camera.interface import FrameFault, Image

_BLACK_LEVEL = 16
"""Grey level below which the brightest pixels of an image are black; an estimate."""
_BRIGHTEST_PERCENT = 95
"""Percentile of the pixels that counts as the brightest of an image; an estimate."""
_SATURATED_LEVEL = 250
"""Grey level from which a pixel counts as saturated; an estimate."""
_SATURATED_SHARE = 0.2
"""Largest share of saturated pixels in a good frame; an estimate."""
_BLOCKS = 16
"""Blocks along a line, whose means are compared from line to line."""
_SEAM_HALF_PX = 2
"""Lines on each side of a seam whose sums are compared."""
_SEAM_RANKS = (3, 4)
"""Of the blocks along a line, between which the lowest quarter of 16 ends: a seam may be weak in those."""
_SEAM_LEVELS = 6.0
"""Rendered frames of all fruit on many units stay below 3.6, torn and shifted ones above 8.8."""
_SEAM_AROUND_PX = 20
"""Lines on each side of a step, whose median it is compared with; an estimate."""
_BASELINE_SHAPE = (40, 30)
"""Rows and columns to which the frame before is reduced; an estimate."""
_FITS_BETTER = 0.85
"""A frame is shifted if the error after rolling it back is below this share of the error before; an estimate."""


class FrameHealth:
    """Checks one camera's frames, of a shape (rows, columns), in their order; older than `oldest_s` they are stale.

    A seam is a line across the whole image with a step along all of it; nothing pressed into a gel makes one. With the
    image rolled back to the seam it either fits the light of the frame before (shifted) or not (torn).
    """

    def __init__(self, oldest_s: float, shape: tuple[int, int]) -> None:
        self._oldest_s, self._shape = oldest_s, shape
        self._baseline: npt.NDArray[np.float32] | None = None

    def judge(self, image: Image, before: Image | None, age_s: float) -> frozenset[FrameFault]:
        """Return the faults of a frame; none for a good one.

        Args:
            image: shape (height, width, 3), dtype uint8.
            before: the camera's frame just before it; None for its first.
            age_s: time since its capture.
        """
        faults: set[FrameFault] = set()
        if age_s > self._oldest_s:
            faults.add(FrameFault.STALE)
        if before is not None and np.array_equal(image, before):
            faults.add(FrameFault.REPEATED)
        if image.shape[:2] != self._shape:
            return frozenset(faults | {FrameFault.WRONG_SIZE})
        coarse = cv2.resize(image, _BASELINE_SHAPE[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
        if np.percentile(coarse.max(axis=2), _BRIGHTEST_PERCENT) < _BLACK_LEVEL:
            return frozenset(faults | {FrameFault.BLACK})
        if np.mean(coarse.max(axis=2) >= _SATURATED_LEVEL) > _SATURATED_SHARE:
            return frozenset(faults | {FrameFault.SATURATED})
        broken = self._broken(image, coarse)
        if broken:
            faults.add(broken)
        elif not faults:
            self._baseline = coarse
        return frozenset(faults)

    def _broken(self, image: Image, coarse: npt.NDArray[np.float32]) -> FrameFault | None:
        """Return torn or shifted, if there is a seam; a shifted frame has exactly one."""
        seams = [(axis, seam) for axis in (0, 1) if (seam := find_seam(image, axis)) is not None]
        if not seams:
            return None
        if len(seams) > 1 or self._baseline is None:
            return FrameFault.TORN
        [(axis, seam)] = seams
        rolled = np.roll(coarse, -round(seam * _BASELINE_SHAPE[axis] / image.shape[axis]), axis=axis)
        as_is, put_right = np.abs(coarse - self._baseline).mean(), np.abs(rolled - self._baseline).mean()
        return FrameFault.SHIFTED if put_right < _FITS_BETTER * as_is else FrameFault.TORN


def find_seam(image: Image, axis: int) -> int | None:
    """Return the line at which the whole image steps, or None if there is none.

    A step is distinguished from a steep but smooth slope by extrapolating the slopes on both sides.

    Args:
        image: shape (height, width, 3), dtype uint8.
        axis: 0 for a seam between two rows, 1 for one between two columns.

    Returns:
        The index of the first line beyond the seam.
    """
    height, width = image.shape[:2]
    size = (_BLOCKS, height) if axis == 0 else (width, _BLOCKS)
    blocks = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    lines = np.asarray(blocks if axis == 0 else cv2.transpose(blocks), np.float32)
    half = _SEAM_HALF_PX
    sums = lines[1:] + lines[:-1]  # of so many lines
    change = sums[half:] - sums[:-half]
    beside = (change[: -4 * half] + change[4 * half :]) / 2
    blue, green, red = np.moveaxis(np.abs(change[2 * half : -2 * half] - beside), 2, 0)
    step = np.maximum(np.maximum(blue, green), red) / half
    low, high = np.moveaxis(np.partition(step, _SEAM_RANKS, axis=1)[:, _SEAM_RANKS], 1, 0)
    whole = (low + 3 * high) / 4
    place = int(np.argmax(whole))
    around = np.median(whole[max(0, place - _SEAM_AROUND_PX) : place + _SEAM_AROUND_PX + 1])
    # `step` begins 2 * half places into `change`, and a seam is `half` lines after the first line of its change.
    return place + 3 * half if whole[place] - around > _SEAM_LEVELS else None
