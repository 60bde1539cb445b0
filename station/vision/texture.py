"""Texture segmentation: a contact of achenes or drupelets is the union of what is pressed in, no smooth outline."""

import cv2
import numpy as np

from station.vision.background import quantile
from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask
from station.vision.region import CHANGE_BLUR_PX

_STRONG_QUANTILE = 0.8
"""Of a region's change: its strong part. At 0.9 the fit's cost is 0.008 to 0.015 higher, at 0.75 0.003 to 0.014."""
_LEVELS_TRIED = (0.7, 1.4)
"""Factors on the level, one twice the other: how much the area changes between them gives the confidence."""
_GROOVE_PX, _SPECK_PX, _ROOM_PX = 7, 5, 9
"""At the working size: the widths of grooves that are bridged and of specks that are dropped, and of the room around a
region."""


def strength(length: FloatImage, region: Mask) -> float:
    """Return what a change's strongest fifth, shape (height, width), reaches in a region, not empty; grey levels."""
    few = length[::2, ::2][region[::2, ::2] > 0]
    return quantile(few if few.size else length[region > 0], _STRONG_QUANTILE)


def element_level(length: FloatImage, region: Mask, coherence: float, constants: Constants) -> float:
    """The change from which on a place belongs to an element that is pressed in, grey levels.

    The more elements there are, the less the outermost are pressed, and the less their directions agree. Where there is
    room for a few only, directions say nothing, and each ends at about half its height.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not, not empty.
        coherence: the region's.
        constants: the levels.
    """
    p = constants
    few = min(1.0, (p.few_elements_px / cv2.countNonZero(region)) ** 2)
    share = max(p.element_random + p.element_coherent * coherence, p.element_lone * few)
    return share * strength(length, region)


def union(length: FloatImage, region: Mask, level: float, constants: Constants) -> tuple[Mask, float]:
    """Find what is pressed in within a region and close to it, grooves bridged and holes filled, with a confidence.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        level: from `element_level`.
        constants: `half_sure`, how fast the confidence falls as the area depends on the level.

    Returns:
        The mask, shape of `length`, 0 or 255; and the confidence, 0 to 1, lower if the area depends on the level.
    """
    groove, speck, room = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_GROOVE_PX, _SPECK_PX, _ROOM_PX)
    )
    smooth = cv2.GaussianBlur(length, (0, 0), CHANGE_BLUR_PX)
    near = np.asarray(cv2.dilate(region, room), np.uint8)
    pressed = (smooth > level).astype(np.uint8) & near
    # Pixels above 0.7 and above 1.4 times the level.
    low, high = (1 + np.count_nonzero((smooth > factor * level) & (near > 0)) for factor in _LEVELS_TRIED)
    sure = 1 / (1 + (np.log(low / high) / constants.half_sure) ** 2)
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8), float(sure)
