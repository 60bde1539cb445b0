"""The size at which the robust method works, so that its parameters mean the same for every camera mode."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Image

LONG_SIDE_PX = 320
"""Long side of a working image; a smaller image is taken as it is."""

SATURATED_LEVEL = 248
"""Grey level from which a channel is taken as saturated: the sensor's own processing stops short of 255."""

HALF_FROM_PX = 2.5
"""Standard deviation beyond which a Gaussian window is applied at half the size: it loses nothing, in a quarter of the
time."""

PRINTED_LONG_SIDE_PX, PRINTED_IMAGE_PX = 640, 640 * 480
"""Long side and area of the image for which parameters in pixels are given: they scale with the image."""

SUBPIXEL_BITS = 4
"""Of a fixed-point coordinate that is drawn: a sixteenth of a pixel."""

NEXT_TO_NOTHING = 1e-3
"""Added, or least, where a division needs more than 0: of grey levels, their squares and weights alike far below what
a sensor shows."""

_SUM = np.ones((1, 3), np.float32)
"""Row of ones: `cv2.transform` by it adds up the channels."""


def working_image(image: Image) -> Image:
    """The image, shape (height, width, 3), dtype uint8, averaged down to the working size."""
    height, width = image.shape[:2]
    shrink = LONG_SIDE_PX / max(height, width)
    if shrink >= 1:
        return image
    size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def clipped(image: Image) -> FloatImage:
    """The image, any shape, dtype uint8, cut off where it saturates, as float32."""
    return cv2.threshold(image, SATURATED_LEVEL, 0, cv2.THRESH_TRUNC)[1].astype(np.float32)


def resized(field: FloatImage, size: tuple[int, int]) -> FloatImage:
    """A field at another size: averaged where it shrinks, linear where it grows.

    Args:
        field: shape (height, width) or (height, width, channels), float32.
        size: width and height.
    """
    if size == (field.shape[1], field.shape[0]):
        return field
    shrinking = size[0] < field.shape[1]
    # At exactly half the size the linear mean is the average too, and of colours it takes a third of the time.
    halving = field.ndim == 3 and (2 * size[0], 2 * size[1]) == (field.shape[1], field.shape[0])
    method = cv2.INTER_AREA if shrinking and not halving else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(field, np.float32), size, interpolation=method), np.float32)


def blurred(field: FloatImage, sigma_px: float) -> FloatImage:
    """A field under a Gaussian window: a wide one at half the size, which loses nothing and takes less time."""
    if sigma_px <= HALF_FROM_PX:
        return np.asarray(cv2.GaussianBlur(field, (0, 0), sigma_px), np.float32)
    size = (field.shape[1], field.shape[0])
    half = resized(field, (-(-size[0] // 2), -(-size[1] // 2)))
    return resized(np.asarray(cv2.GaussianBlur(half, (0, 0), sigma_px / 2), np.float32), size)


def length_squared(change: FloatImage) -> FloatImage:
    """The squared length over the channels of a change, (height, width, 3): shape (height, width)."""
    return product(change, change)


def product(one: FloatImage, other: FloatImage) -> FloatImage:
    """The product of two, (height, width, 3), summed over the channels: shape (height, width)."""
    return np.asarray(cv2.transform(cv2.multiply(one, other), _SUM), np.float32)
