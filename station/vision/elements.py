"""A contact of seeds or drupelets: the union of what is pressed in takes the place of one smooth outline."""

import cv2
import numpy as np

from station.vision.body import Body
from station.vision.contact import FloatImage, Mask

_BLUR_PX = 2.0
_STRONG_QUANTILE = 0.8
_SHARE_OF_RANDOM, _SHARE_OF_COHERENCE = 0.09, 0.45
_SHARE_OF_FEW, _FEW_PX, _MANY_PX = 0.27, 34.0, 50.0
_GROOVE_PX, _SPECK_PX, _ROOM_PX = 9, 7, 9


def level(length: FloatImage, region: Mask, body: Body) -> float:
    """The change from which on a place belongs to an element that is pressed in, grey levels.

    A lone element ends where half of its change is gone; the more there are, the less the outermost are pressed, and
    the less their directions agree.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        body: its coherence is used.
    """
    radius_px = np.sqrt(cv2.countNonZero(region) / np.pi)
    few = float(np.clip((_MANY_PX - radius_px) / (_MANY_PX - _FEW_PX), 0, 1))
    share = _SHARE_OF_RANDOM + _SHARE_OF_COHERENCE * body.coherence + _SHARE_OF_FEW * few
    return share * float(np.quantile(length[region > 0], _STRONG_QUANTILE))


def union(length: FloatImage, region: Mask, level_levels: float) -> Mask:
    """What is pressed in within a region and close to it, grooves bridged and holes filled.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        level_levels: from `level`.

    Returns:
        Shape of `length`, 0 or 255.
    """
    groove, speck, room = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_GROOVE_PX, _SPECK_PX, _ROOM_PX)
    )
    smooth = cv2.GaussianBlur(length, (0, 0), _BLUR_PX)
    pressed = (smooth > level_levels).astype(np.uint8) & cv2.dilate(region, room)
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8)
