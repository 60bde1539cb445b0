"""Debris on the gel: dents that the reference shows too, which a contact hides or moves about.

Under a contact a particle's own pattern is missing from the frame, so the change shows the particle although nothing of
it is new. Where the change is shorter with that pattern given back, the particle is hidden, and that is used. Where it
is not, the particle is still visible, its slope has not changed, and the place is of no use: it is filled from around.
"""

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.contact import FloatImage
from station.vision.working import NEXT_TO_NOTHING, length_squared, resized

_FINE_PX, _COARSE_PX, _LENGTH_PX = 1.0, 4.0, 1.5
"""At half the working size, of the Gaussians between which a particle is, 0.1 to 0.4 mm, and of its strength. What is
compared has the finer as its window, the filling the coarser."""
_LEAST_LEVELS = 10.0
"""Of what is fine in the reference: without debris it reaches 6 on the twin and 8 on the real presses' reference."""
_RING_PX, _HALO_PX = 9, 5
"""At half the working size: over a particle's dark middle, and what it changes around it; kernels of 1.0 and 0.5 mm."""
_LONGEST_PX = 40
"""At half the working size, about 4 mm, two particles side by side: what is longer is the edge of a beam of light."""
_INPAINT_PX, _INPAINTED_BLUR_PX = 3, 2.0
"""At the working size: how far around a particle its surroundings are continued from, and their smoothing."""
_STEEPEST = 0.4
"""Gate over the root of the contact's area, px of half the working size. Judged contacts reach 0.38, raspberries;
judged specks that had moved begin at 0.42: measured on 100 gels of the twin with debris, and on 220 contacts."""


class Debris:
    """The debris on one reference, at the working size, shape (height, width, 3), grey levels."""

    def __init__(self, light: FloatImage) -> None:
        height, width = light.shape[:2]
        self._half = (-(-width // 2), -(-height // 2))
        half = resized(light, self._half)
        finest, coarse = (cv2.GaussianBlur(half, (0, 0), sigma) for sigma in (_FINE_PX, _COARSE_PX))
        fine = finest - coarse
        for axis in (0, 1):
            fine -= np.median(fine, axis=axis, keepdims=True)
        length = cv2.GaussianBlur(cv2.sqrt(length_squared(fine)), (0, 0), _LENGTH_PX)
        ring, halo = (cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_RING_PX, _HALO_PX))
        seen = cv2.morphologyEx((length > _LEAST_LEVELS).astype(np.uint8), cv2.MORPH_CLOSE, ring)
        _, labels, boxes, _ = cv2.connectedComponentsWithStats(cv2.dilate(seen, halo))
        longest = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
        seen = ((labels > 0) & (longest <= _LONGEST_PX)[labels]).astype(np.uint8)
        self.clean = np.asarray(1 - seen, np.float32)
        """Where there is none, at half the working size, 0 or 1."""
        self._places = seen > 0
        wide = cv2.resize(seen, (width, height), interpolation=cv2.INTER_NEAREST) > 0
        self._pattern = resized(_pattern(light, wide), self._half) if seen.any() else None

    def may_be(self, gate: float, area_px: int) -> bool:
        """Return whether, on a gel with debris, a contact is too steep for its size to be any but moved debris.

        Args:
            gate: the strongest curvature over the detection threshold.
            area_px: the contact's area, px of half the working size.
        """
        return self._pattern is not None and gate > _STEEPEST * area_px**0.5

    def bridged(self, change: FloatImage) -> FloatImage:
        """A change in which debris neither hides nor feigns a contact, in place.

        Args:
            change: at half the working size, shape (height, width, 3), grey levels.

        Returns:
            The change.
        """
        if self._pattern is None:
            return change
        given_back = change + self._pattern
        shown, hidden = (cv2.GaussianBlur(length_squared(one), (0, 0), _FINE_PX) for one in (change, given_back))
        is_hidden = hidden < shown
        valid = np.maximum(self.clean, is_hidden)
        known = np.where(is_hidden[..., None], given_back, change) * valid[..., None]
        weight = np.maximum(cv2.GaussianBlur(valid, (0, 0), _COARSE_PX), NEXT_TO_NOTHING)
        around = np.asarray(cv2.GaussianBlur(known, (0, 0), _COARSE_PX) / weight[..., None], np.float32)
        filled = np.where(is_hidden[..., None], given_back, around)
        change[self._places] = filled[self._places]
        return change


def _pattern(light: FloatImage, places: npt.NDArray[np.bool_]) -> FloatImage:
    """Return what the debris adds to the reference: the reference less its continued surroundings, else zero."""
    # Wider than the debris, so that its rim is not continued into its place.
    wide = cv2.dilate(places.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_HALO_PX, _HALO_PX)))
    without = cv2.inpaint(light.astype(np.uint8), wide, _INPAINT_PX, cv2.INPAINT_NS).astype(np.float32)
    smooth = cv2.GaussianBlur(without, (0, 0), _INPAINTED_BLUR_PX)
    return np.where(places[..., None], light - smooth, np.float32(0))
