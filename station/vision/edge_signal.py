"""The quantity whose steepest fall is a contact's edge: the change's length."""

import cv2
import numpy as np

from station.vision.contact import FloatImage
from station.vision.working import length_squared

_BLUR_SHARE = 0.045
_BLUR_PX = (1.0, 3.5)
_HALF_FROM_PX = 2.0


def denoised(change: FloatImage, half: FloatImage, radius_px: float) -> FloatImage:
    """The change smoothed as far as a contact of that size allows.

    Args:
        change: shape (height, width, 3), grey levels.
        half: the same averaged down to half the size.
        radius_px: of a circle of the candidate region's area.

    Returns:
        Of the change's size, or of half that where so much is smoothed that nothing is lost by it.
    """
    sigma = float(np.clip(_BLUR_SHARE * radius_px, *_BLUR_PX))
    if sigma < _HALF_FROM_PX:
        return np.asarray(cv2.GaussianBlur(change, (0, 0), sigma), np.float32)
    return np.asarray(cv2.GaussianBlur(half, (0, 0), sigma / 2), np.float32)


def length_of(change: FloatImage) -> FloatImage:
    """The change's length over the channels.

    Args:
        change: shape (height, width, 3), grey levels.

    Returns:
        Shape (height, width), grey levels.
    """
    return np.asarray(cv2.sqrt(length_squared(change)), np.float32)
