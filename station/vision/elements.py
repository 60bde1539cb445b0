"""A contact of seeds or drupelets that show apart: their union in place of one smooth outline."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Mask

_FEW = 7.0
_BLUR_PX = 2.0
_STRONG_QUANTILE = 0.8
_RADII = (5.5, 7.0, 8.0)
_LEVEL_SHARES = (0.45, 0.25, 0.15)
"""A lone element ends where half of its change is gone; the more there are, the less the outermost are pressed."""
_CLEAR_OF_NOISE = 8.0
_GROOVE_PX, _SPECK_PX = 9, 7


def level(length: FloatImage, inside: Mask, element_px: float) -> float:
    """The change from which on a place belongs to an element that is pressed in, grey levels.

    Args:
        length: of the change, shape (height, width), grey levels.
        inside: an outline filled, shape of `length`, 0 or not.
        element_px: from `edge_signal.element_px`.
    """
    radii = np.sqrt(cv2.countNonZero(inside) / np.pi) / element_px
    strong = float(np.quantile(length[inside > 0], _STRONG_QUANTILE))
    return float(np.interp(radii, _RADII, _LEVEL_SHARES)) * strong


def show_apart(inside: Mask, element_px: float, level_over_noise: float) -> bool:
    """Whether elements are seen singly: there are few, within seven of their lengths, or they stand clear of the noise.

    Args:
        inside: an outline filled, shape (height, width), 0 or not.
        element_px: from `edge_signal.element_px`.
        level_over_noise: how far `level` lies above the background, in units of its spread.
    """
    few = cv2.countNonZero(inside) < np.pi * (_FEW * element_px) ** 2
    return bool(few or level_over_noise > _CLEAR_OF_NOISE)


def union(length: FloatImage, around: Mask, level_levels: float) -> Mask:
    """What is pressed in, grooves bridged and holes filled.

    Args:
        length: of the change, shape (height, width), grey levels.
        around: where elements may lie, shape of `length`, 0 or not.
        level_levels: from `level`.

    Returns:
        Shape of `length`, 0 or 255.
    """
    smooth = cv2.GaussianBlur(length, (0, 0), _BLUR_PX)
    pressed = ((smooth > level_levels) & (around > 0)).astype(np.uint8)
    groove, speck = (cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (_GROOVE_PX, _SPECK_PX))
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8)
