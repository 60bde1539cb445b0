"""How much the gel bends at each place, as the colours show it, and the gate that asks whether anything touches.

The colour of a place follows the gel's slope there (photometric stereo), so the gradient of the signed change follows
its curvature. A body pressed into the gel curves it in both directions all over the contact, in its flat dark centre
too; a smooth drift does so hardly, a streak in one direction only. Taken is twice the geometric mean of the two
eigenvalues of the local structure tensor, summed over the channels, whose root has the unit grey level per pixel.
"""

import cv2
import numpy as np

from station.vision.background import weighted_median
from station.vision.contact import FloatImage

_SIGMA_PX = 5.0
_WINDOW_SIGMA_PX = 7.5
_CALM_RATIO = 2.2
_NOISE_CAP = 0.35
_LEAST_BACKGROUND = 0.02


def bending(change: FloatImage, step: int) -> FloatImage:
    """How much the gel bends.

    Args:
        change: signed, averaged down by `step`, shape (height, width, 3), grey levels.
        step: by how much it is smaller than the working image.

    Returns:
        Shape (height, width), grey levels per pixel of the working image.
    """
    smooth = cv2.GaussianBlur(change, (0, 0), _SIGMA_PX / step)
    slope_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / (8 * step))
    slope_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / (8 * step))
    ones = np.ones((1, 3), np.float32)
    xx, yy, xy = (
        cv2.GaussianBlur(cv2.transform(cv2.multiply(a, b), ones), (0, 0), _WINDOW_SIGMA_PX / step)
        for a, b in ((slope_x, slope_x), (slope_y, slope_y), (slope_x, slope_y))
    )
    determinant = np.maximum(xx * yy - xy * xy, 0)
    return np.sqrt(2 * np.sqrt(determinant), dtype=np.float32)


def quiet(bend: FloatImage, least_bend: float) -> FloatImage:
    """A first guess of the background: what bends little more than the calmest twentieth of the frame.

    What such places enclose, as a contact's ring does its flat centre, is no background either.

    Args:
        bend: of the difference with its drift, grey levels per pixel.
        least_bend: the gate's lower limit, grey levels per pixel; half as much again surely is no background.

    Returns:
        Shape of `bend`, 0 to 1.
    """
    calmest = float(np.partition(bend, bend.size // 20, axis=None)[bend.size // 20])
    limit = min(_CALM_RATIO * calmest, 1.45 * least_bend) + 0.15 * least_bend
    outlines, _ = cv2.findContours((bend > limit).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    enclosed = cv2.drawContours(np.zeros(bend.shape, np.uint8), outlines, -1, 1, cv2.FILLED)
    fourth = np.square(np.square(bend * np.float32(1 / limit)))
    return np.square(np.maximum(0, 1 - fourth)) * (enclosed == 0)


def noise_of(bend: FloatImage, background: FloatImage) -> float:
    """The bending that the background shows: its median there, at most what noise has been seen to reach.

    Args:
        bend: without drift, grey levels per pixel.
        background: shape of `bend`, 0 to 1.
    """
    if background.sum() < _LEAST_BACKGROUND * background.size:
        return 0.0
    return min(weighted_median(bend, background), _NOISE_CAP)
