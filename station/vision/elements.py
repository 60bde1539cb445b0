"""A contact of few seeds or drupelets, which the gel does not bridge yet: their union in place of one outline."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Mask

_FEW = 7.0
_BLUR_PX = 2.0
_STRONG_QUANTILE, _LEVEL_SHARE = 0.8, 0.35
_GROOVE_PX, _SPECK_PX = 9, 7


def are_few(inside: Mask, element_px: float) -> bool:
    """Whether an outline is so small that its elements show apart: of a radius below seven of their lengths.

    Args:
        inside: the outline filled, shape (height, width), 0 or not.
        element_px: from `edge_signal.element_px`.
    """
    return bool(np.count_nonzero(inside) < np.pi * (_FEW * element_px) ** 2)


def union(length: FloatImage, inside: Mask) -> Mask:
    """What of an outline is pressed in: over about a third of its strong change, grooves bridged and holes filled.

    Args:
        length: of the change, shape (height, width), grey levels.
        inside: the outline filled, shape of `length`, 0 or not.

    Returns:
        Shape of `length`, 0 or 255.
    """
    smooth = cv2.GaussianBlur(length, (0, 0), _BLUR_PX)
    level = _LEVEL_SHARE * float(np.quantile(smooth[inside > 0], _STRONG_QUANTILE))
    pressed = ((smooth > level) & (inside > 0)).astype(np.uint8)
    groove, speck = (cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_GROOVE_PX, _SPECK_PX))
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8)
