"""Light and sharpness of a picture of the untouched gel, for comparison with an earlier one."""

import cv2
import numpy as np

from station.vision.contact import Image

_DETAIL_PX = (5.0, 15.0)
"""The difference of these two blurs is the detail that a lens shows and fog hides, coarser than the pixels' noise."""
_SATURATED_LEVEL = 250
"""Grey level from which a pixel counts as saturated in any colour: an estimate."""
DEAD_LED = 1 / 3
"""Share of a colour's light below which its LED is dead."""


def light(image: Image) -> tuple[float, float, float]:
    """Return the mean of each colour of a picture, shape (height, width, 3), dtype uint8, BGR; grey levels."""
    blue, green, red = image.mean(axis=(0, 1))
    return float(blue), float(green), float(red)


def saturated_share(image: Image) -> float:
    """Return the share of saturated pixels of an image, shape (height, width, 3), dtype uint8."""
    return float(np.mean(image.max(axis=2) >= _SATURATED_LEVEL))


def sharpness(image: Image) -> float:
    """Return the root mean square, grey levels, of the detail that a lens shows and fog hides; dtype uint8."""
    finer, coarser = (cv2.GaussianBlur(image, (0, 0), sigma).astype(np.float32) for sigma in _DETAIL_PX)
    detail = finer - coarser
    detail -= detail.mean(axis=0)  # the light drifts in bands along the columns, which is no detail
    return float(np.sqrt(np.mean(detail**2)))
