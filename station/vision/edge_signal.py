"""The quantity whose steepest fall is a contact's edge: the change's length, or its envelope on textured skin."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Mask
from station.vision.working import length_squared, resized

_BLUR_SHARE = 0.045
_BLUR_PX = (1.0, 3.5)
_HALF_FROM_PX = 2.0
_TEXTURED_SHARE = 0.15
_WINDOW_SHARE = 0.7


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


def element_px(length: FloatImage, bend: FloatImage, region: Mask) -> float:
    """Length over bending: half the radius or so for a smooth body, the size of a seed or drupelet for a textured one.

    Args:
        length: shape (height, width), grey levels.
        bend: any size, grey levels per pixel of `length`.
        region: the candidate's, shape (height, width), 0 or not.
    """
    small = resized(region.astype(np.float32), (bend.shape[1], bend.shape[0])) > 0
    return float(length[region > 0].mean() / bend[small].mean())


def is_textured(element: float, radius_px: float) -> bool:
    """Whether the elements are too small for a smooth body of that size.

    Args:
        element: from `element_px`.
        radius_px: of a circle of the region's area.
    """
    return element < _TEXTURED_SHARE * radius_px


def envelope(length: FloatImage, inside: Mask, quantile: float, element: float) -> FloatImage:
    """The length capped at what most of a place reaches, averaged over about one element.

    Single seeds and drupelets then no longer outshine the body's edge.

    Args:
        length: shape (height, width), grey levels.
        inside: where the cap is taken, shape of `length`, 0 or not.
        quantile: of the length there, the cap.
        element: from `element_px`.
    """
    size = ((length.shape[1] + 1) // 2, (length.shape[0] + 1) // 2)
    half = resized(length, size)
    values = half[resized((inside > 0).astype(np.float32), size) > 0]
    place = int(quantile * (values.size - 1))
    capped = np.minimum(half, np.partition(values, place)[place])
    smooth = cv2.GaussianBlur(capped, (0, 0), max(_BLUR_PX[0], _WINDOW_SHARE * element) / 2)
    return resized(np.asarray(smooth, np.float32), (length.shape[1], length.shape[0]))
