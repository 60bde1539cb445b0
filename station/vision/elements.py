"""A contact of seeds or drupelets: the union of what is pressed in takes the place of one smooth outline."""

import cv2
import numpy as np

from station.vision.body import Body
from station.vision.contact import FloatImage, Mask

_BLUR_PX = 2.0
_STRONG_QUANTILE = 0.8
_SHARE_OF_RANDOM, _SHARE_OF_COHERENCE = 0.09, 0.45
_SHARE_OF_FEW, _FEW_PX, _MANY_PX = 0.27, 34.0, 50.0
_LEVELS_TRIED = (0.7, 1.4)
_HALF_SURE = 0.45
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
    strong = length[region > 0]
    place = int(_STRONG_QUANTILE * (strong.size - 1))
    return share * float(np.partition(strong, place)[place])


def union(length: FloatImage, region: Mask, level_levels: float) -> tuple[Mask, float]:
    """What is pressed in within a region and close to it, grooves bridged and holes filled, and how sure that is.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        level_levels: from `level`.

    Returns:
        Shape of `length`, 0 or 255; and 0 to 1, the less the more the pressed place hangs on the level: one half
        where twice the level leaves two thirds of it.
    """
    groove, speck, room = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_GROOVE_PX, _SPECK_PX, _ROOM_PX)
    )
    smooth = cv2.GaussianBlur(length, (0, 0), _BLUR_PX)
    near = np.asarray(cv2.dilate(region, room), np.uint8)
    pressed = (smooth > level_levels).astype(np.uint8) & near
    low, high = (1 + np.count_nonzero((smooth > factor * level_levels) & (near > 0)) for factor in _LEVELS_TRIED)
    sure = 1 / (1 + (np.log(low / high) / _HALF_SURE) ** 2)
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8), float(sure)
