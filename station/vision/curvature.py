"""Curvature response: how much the gel curves at each place, as the colours show it, and the background's noise in it.

The colour of a place follows the gel's slope there (photometric stereo), so the gradient of the signed change follows
its curvature. A body pressed into the gel curves it in both directions all over the contact, in its flat dark centre
too; a smooth change of light does so hardly, a streak in one direction only. Taken is twice the geometric mean of the
two eigenvalues of the local structure tensor, summed over the channels, whose root has the unit grey level per pixel.
"""

import cv2
import numpy as np

from station.vision.background import LEAST_BACKGROUND, Background, quantile, weighted_median
from station.vision.constants import Constants
from station.vision.contact import FloatImage
from station.vision.working import HALF_FROM_PX, product, resized

_CALMEST = 0.05
"""The share of the frame that is background for certain, before anything is known."""
_LIMIT_FLOOR = 0.15
"""Of `least_curvature`: added to the limit, so that an image without noise has a background too."""


def curvature(change: FloatImage, step: int, constants: Constants) -> FloatImage:
    """The curvature response of a change.

    Args:
        change: signed, averaged down by `step`, shape (height, width, 3), grey levels.
        step: by how much it is smaller than the working image.
        constants: the two smoothings.

    Returns:
        Shape (height, width), grey levels per pixel of the working image.
    """
    smooth = cv2.GaussianBlur(change, (0, 0), constants.curvature_blur / step)
    # By Sobel's kernel a slope of 1 per pixel is 8, and a pixel here is `step` pixels of the working image.
    slope_x, slope_y = (
        np.asarray(cv2.Sobel(smooth, cv2.CV_32F, dx, dy, scale=1 / (8 * step)), np.float32)
        for dx, dy in ((1, 0), (0, 1))
    )
    # The three entries of the structure tensor, the colours added up before the window: it is linear.
    products = ((slope_x, slope_x), (slope_y, slope_y), (slope_x, slope_y))
    tensor = cv2.merge([product(a, b) for a, b in products])
    height, width = change.shape[:2]
    window = constants.curvature_window / step
    if window > HALF_FROM_PX:  # a wide window loses nothing at half the size, and takes a quarter of the time
        tensor, window = resized(np.asarray(tensor, np.float32), (-(-width // 2), -(-height // 2))), window / 2
    xx, yy, xy = cv2.split(cv2.GaussianBlur(tensor, (0, 0), window))
    determinant = np.maximum(xx * yy - xy * xy, 0)
    return resized(np.sqrt(2 * np.sqrt(determinant), dtype=np.float32), (width, height))


def first_background(response: FloatImage, least_curvature: float, constants: Constants) -> FloatImage:
    """A first guess of the background: what curves little more than the calmest twentieth of the frame.

    What such places enclose, as a contact's ring does its flat centre, is no background either.

    Args:
        response: of the difference with its background still in it, grey levels per pixel.
        least_curvature: the recipe's lower limit of the detection threshold, grey levels per pixel.
        constants: the two limits.

    Returns:
        Shape of `response`, 0 to 1.
    """
    calmest = quantile(response, _CALMEST)
    limit = min(constants.calm_ratio * calmest, (constants.calm_limit - _LIMIT_FLOOR) * least_curvature)
    limit += _LIMIT_FLOOR * least_curvature
    outlines, _ = cv2.findContours((response > limit).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    enclosed = cv2.drawContours(np.zeros(response.shape, np.uint8), outlines, -1, 1, cv2.FILLED)
    fourth = np.square(np.square(response * np.float32(1 / limit)))
    return np.square(np.maximum(0, 1 - fourth)) * (enclosed == 0)


def curvature_noise(response: FloatImage, background: Background) -> float:
    """The median of the curvature, grey levels per pixel, that the background of the same frame shows."""
    if background.share < LEAST_BACKGROUND:
        return 0.0
    weight = resized(background.weight, (response.shape[1], response.shape[0]))
    return weighted_median(response, weight)
