"""Reference check: whether a frame and its reference show the same sensor unit.

Every unit has a pattern of light of its own: the edges of the LEDs' beams, specks, bubbles. Light drifts smoothly, and
a contact adds to the pattern without removing it, so a frame of the same unit holds the reference's pattern at full
strength and a frame of another unit does not. The statistic is the share of the reference's pattern that is missing
in the frame: one minus the slope of a weighted regression of the frame's pattern on the reference's. It is about 0 for
the same unit, untouched or pressed, and about 0.8 for another. A unit whose pattern is too weak to be recognised
(smooth optics) passes, and so does a frame whose light differs from the reference's by less than units differ.
"""

import cv2
import numpy as np

from station.vision.contact import FloatImage
from station.vision.working import length_squared, resized

_CELLS = 80
"""Cells along the long side, 4 px of a 320 px image: finer pattern is lost in noise, compression and shifts."""
_BAND_CELLS = (1.0, 4.0)
"""Standard deviations of the Gaussians whose difference is the pattern, about 0.2 to 0.9 mm: wider is drift."""
_KNOWN_LEVELS_SQUARED = 3.0
"""One grey level squared per colour, what noise and compression leave in a cell. A pattern as weak as that decides
nothing: this much is counted as found, everywhere."""
_MOST_MISSING = 0.3
"""Of the pattern. Chosen on these same images, none held back: a unit against itself stays below on real images under
noise, compression, drift and presses up to the whole field (787 of 787), pairs of other real units are above it (14,429
of 14,522 draws of 19 units). The twin's units share a few modes of light: there 85 of 100 pairs are above it."""
_LEAST_LIGHT_CHANGE_LEVELS = 5.0
"""Standard deviation over the frame. Between real units it is 8 and more; without it, compression that wipes out a
weak pattern would pass for another unit."""


class ReferenceCheck:
    """Compares frames with one reference.

    Args:
        reference: the untouched gel, cut off where it saturates, at half the working size, shape (height, width, 3),
            grey levels.
    """

    def __init__(self, reference: FloatImage) -> None:
        self._cells = _cells(reference)
        self._pattern = _pattern(self._cells)
        self._energy = length_squared(self._pattern)

    def mismatch(self, frame: FloatImage) -> float:
        """The statistic over its threshold: above 1 the frame shows another unit, or another sensor.

        Args:
            frame: cut off and averaged down as the reference.
        """
        cells = _cells(frame)
        _, spread = cv2.meanStdDev(cells - self._cells)
        # A gain or an offset of a colour says nothing about the unit: only what varies over the frame is compared.
        light = float(np.sqrt(np.mean(np.square(spread)))) / _LEAST_LIGHT_CHANGE_LEVELS
        return light if light <= 1 else min(light, self._missing_share(_pattern(cells)) / _MOST_MISSING)

    def _missing_share(self, pattern: FloatImage) -> float:
        """One minus the slope of a frame's pattern on the reference's, 0 for the same unit.

        A contact's edge outshines the pattern: places count by the inverse of what both images show there, so that
        a sharp contact over the whole frame cannot outvote what shows between its edges.

        Args:
            pattern: the frame's, shape (rows, columns, 3), grey levels.
        """
        common = cv2.transform(cv2.multiply(pattern, self._pattern), np.ones((1, 3), np.float32))
        weight = 1.0 / (length_squared(pattern) + self._energy + _KNOWN_LEVELS_SQUARED)
        found = float(np.vdot(common + _KNOWN_LEVELS_SQUARED, weight))
        expected = float(np.vdot(self._energy + _KNOWN_LEVELS_SQUARED, weight))
        return 1.0 - found / expected


def _cells(image: FloatImage) -> FloatImage:
    """An image averaged over cells, in whole grey levels, shape (rows, columns, 3)."""
    height, width = image.shape[:2]
    scale = _CELLS / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.rint(resized(image, size))


def _pattern(cells: FloatImage) -> FloatImage:
    """What is between noise and drift in size, less each column's mean: streaks along the columns drift.

    Args:
        cells: shape (rows, columns, 3), grey levels.
    """
    fine, wide = (cv2.GaussianBlur(cells, (0, 0), sigma) for sigma in _BAND_CELLS)
    band = fine - wide
    return np.asarray(band - cv2.reduce(band, 0, cv2.REDUCE_AVG), np.float32)
