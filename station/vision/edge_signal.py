"""The quantity whose steepest fall is a contact's edge."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Mask
from station.vision.working import resized

_BLUR_SHARE = 0.045
_BLUR_PX = (1.0, 3.5)
_TEXTURED_SHARE = 0.15
_CAP_QUANTILE = 0.4
_WINDOW_SHARE = 0.7


def denoised(change: FloatImage, radius_px: float) -> FloatImage:
    """The change smoothed as far as a contact of that size allows.

    Args:
        change: shape (height, width, 3), grey levels.
        radius_px: of a circle of the candidate region's area.
    """
    sigma = float(np.clip(_BLUR_SHARE * radius_px, *_BLUR_PX))
    return np.asarray(cv2.GaussianBlur(change, (0, 0), sigma), np.float32)


def length_of(change: FloatImage) -> FloatImage:
    """The change's length over the channels.

    Args:
        change: shape (height, width, 3), grey levels.

    Returns:
        Shape (height, width), grey levels.
    """
    ones = np.ones((1, 3), np.float32)
    return np.asarray(cv2.sqrt(cv2.transform(cv2.multiply(change, change), ones)), np.float32)


def edge_signal(smooth: FloatImage, bend: FloatImage, region: Mask, radius_px: float) -> FloatImage:
    """The change's length over the channels; for textured skin its capped and spread envelope.

    Length over bending is a length in the image: about half the radius for a smooth body, the size of a seed or a
    drupelet for a textured one. Where it says texture, single seeds must not outshine the contact's edge: the length
    is capped at what most of the region reaches and averaged (root mean square) over about one element.

    Args:
        smooth: from `denoised`, shape (height, width, 3), grey levels.
        bend: any size, grey levels per pixel of `smooth`.
        region: the candidate's, shape (height, width), 0 or not.
        radius_px: of a circle of that region's area.

    Returns:
        Shape (height, width), grey levels.
    """
    length = length_of(smooth)
    within = length[region > 0]
    small = resized(region.astype(np.float32), (bend.shape[1], bend.shape[0])) > 0
    element_px = float(within.mean() / bend[small].mean())
    if element_px >= _TEXTURED_SHARE * radius_px:
        return length
    capped = np.minimum(length, np.quantile(within, _CAP_QUANTILE))
    spread = cv2.GaussianBlur(capped * capped, (0, 0), max(_BLUR_PX[0], _WINDOW_SHARE * element_px))
    return np.asarray(cv2.sqrt(spread), np.float32)
