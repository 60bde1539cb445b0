"""Compressed frames: images after JPEG, decoded again."""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]


def as_jpeg(image: Image, quality: int) -> Image:
    """The image after JPEG: blocks of 8x8 pixels, colour at half the resolution.

    Args:
        image: shape (rows, columns, 3), BGR.
        quality: 1 to 100, as the JPEG library counts.
    """
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
