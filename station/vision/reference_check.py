"""Reference check: whether a frame and its reference show the same sensor unit.

Every unit has a pattern of light of its own: the edges of the LEDs' beams, specks, bubbles. Light drifts smoothly, and
a contact adds to the pattern without removing it. Another unit shows in one of two ways:

- The reference's pattern is missing in the frame: one minus the slope of a weighted regression of the frame's pattern
  on the reference's. It is about 0 for the same unit, untouched or pressed, and about 0.8 for another.
- Two units may share much of their pattern. Then what the reference's pattern does not explain in the frame is as
  strong as that pattern, and so everywhere and in patterns of two sizes alike. A contact is strong in some places or in
  one of the sizes; fog weakens the pattern and adds nothing to it.

A unit whose pattern is too weak to be recognised (smooth optics) passes, and so does a frame whose light differs from
the reference's by less than units differ.
"""

import cv2
import numpy as np

from station.vision.contact import FloatImage
from station.vision.working import length_squared, product, resized

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
of 14,522 draws of 19 units). Harsher changes can exceed it: JPEG 30 or a fifth less light in 7 of 390 real presses
(`./run bench fit --reference`). The twin's units share a few modes of light: there 85 of 100 pairs are above it."""
_LITTLE_MISSING = 0.4
"""Of `_MOST_MISSING`: below it the second way is spared, as for half of all presses. Pairs of real units that only that
way notices lack 0.72 and more."""
_COARSER = 2
"""How much larger the cells of the second size are."""
_WIDER_BAND_CELLS = (1.4, 4.0)
"""As `_BAND_CELLS`, of the patterns of both sizes: half a period is about 0.3 to 0.9 mm, and twice that."""
_TILE_CELLS = 5
"""Side of the places that are compared, 0.5 mm: half a period of the finer of the two."""
_FLOORS_LEVELS_SQUARED = (10.0, 3.0)
"""Of both sizes, over the colours: what compression leaves in a cell, and noise in the larger ones."""
_LEAST_RATIO = 1e-8
"""Power of what is not explained over the pattern's. Noise is always far above; identical images have none."""
_UNEVEN = 3.5
"""Weight of the unevenness against the logarithm of that power. At 2.5 to 5 the gap of `_LEAST_LIKENESS` is 0.6 to 1.1
wide."""
_LEAST_LIKENESS = -4.9
"""In the middle of the gap between 523 frames of units against themselves (at most -5.34: real presses perturbed, the
twin's presses of the fit's both parts) and the two pairs of real units that the first way misses (-4.36). Fogged lenses
are at -8.2 and below. `./run bench fit --reference` shows what is nearest on either side."""
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
        self._pattern = _pattern(self._cells, _BAND_CELLS)
        self._energy = length_squared(self._pattern)
        self._means = np.maximum(self._cells.mean(axis=(0, 1)), 1.0)
        self._patterns = _patterns(self._cells)
        height, width = self._cells.shape[:2]
        self._tiles = (max(1, width // _TILE_CELLS), max(1, height // _TILE_CELLS))

    def mismatch(self, frame: FloatImage) -> float:
        """The statistic over its threshold: above 1 the frame shows another unit, or another sensor.

        The frame is cut off and averaged down as the reference.
        """
        cells = _cells(frame)
        _, spread = cv2.meanStdDev(cells - self._cells)
        # A gain or an offset of a colour says nothing about the unit: only what varies over the frame is compared.
        light = float(np.sqrt(np.mean(np.square(spread)))) / _LEAST_LIGHT_CHANGE_LEVELS
        if light <= 1:
            return light
        missing = self._missing_share(_pattern(cells, _BAND_CELLS)) / _MOST_MISSING
        if _LITTLE_MISSING < missing <= 1:
            missing = max(missing, float(np.exp(self._likeness(cells) - _LEAST_LIKENESS)))
        return min(light, missing)

    def _missing_share(self, pattern: FloatImage) -> float:
        """One minus the slope of a frame's pattern on the reference's, 0 for the same unit.

        A contact's edge outshines the pattern: places count by the inverse of what both images show there, so that
        a sharp contact over the whole frame cannot outvote what shows between its edges.

        Args:
            pattern: the frame's, shape (rows, columns, 3), grey levels.
        """
        common = product(pattern, self._pattern)
        weight = 1.0 / (length_squared(pattern) + self._energy + _KNOWN_LEVELS_SQUARED)
        found = float(np.vdot(common + _KNOWN_LEVELS_SQUARED, weight))
        expected = float(np.vdot(self._energy + _KNOWN_LEVELS_SQUARED, weight))
        return 1.0 - found / expected

    def _likeness(self, cells: FloatImage) -> float:
        """Return the likeness (log) of what the reference's pattern leaves unexplained to another unit's pattern.

        Args:
            cells: of the frame, shape (rows, columns, 3), grey levels.
        """
        gain = (cells.mean(axis=(0, 1)) / self._means).astype(np.float32)
        strengths: list[float] = []
        unevenness = 0.0
        for own, seen, floor in zip(self._patterns, _patterns(cells), _FLOORS_LEVELS_SQUARED, strict=True):
            known = own * gain
            energy = length_squared(known)
            weight = 1.0 / (length_squared(seen) + energy + floor)
            slope = float(np.vdot(product(known, seen), weight)) / float(np.vdot(energy, weight) + _LEAST_RATIO)
            # By its own slope: fog takes a share of the pattern everywhere alike, and would pass for another unit.
            unexplained = seen - known * min(max(slope, 0.0), 1.0)
            power, pattern = (resized(one, self._tiles) for one in (length_squared(unexplained), energy))
            ratio = np.log(power / (pattern + floor) + _LEAST_RATIO)
            strengths.append(float(ratio.mean()))
            unevenness += float(ratio.std()) / 2
        fine, coarse = strengths
        return (fine + coarse) / 2 - abs(fine - coarse) - _UNEVEN * unevenness


def _cells(image: FloatImage) -> FloatImage:
    """An image averaged over cells, in whole grey levels, shape (rows, columns, 3)."""
    height, width = image.shape[:2]
    scale = _CELLS / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.rint(resized(image, size))


def _patterns(cells: FloatImage) -> list[FloatImage]:
    """The pattern in cells of both sizes, shape (rows, columns, 3) each."""
    coarse = resized(cells, (max(1, cells.shape[1] // _COARSER), max(1, cells.shape[0] // _COARSER)))
    return [_pattern(one, _WIDER_BAND_CELLS) for one in (cells, coarse)]


def _pattern(cells: FloatImage, band_cells: tuple[float, float]) -> FloatImage:
    """Return what is between noise and drift in size, less each column's mean: streaks along the columns drift."""
    fine, wide = (cv2.GaussianBlur(cells, (0, 0), sigma) for sigma in band_cells)
    band = fine - wide
    return np.asarray(band - cv2.reduce(band, 0, cv2.REDUCE_AVG), np.float32)
