"""Compressed frames: images after JPEG, decoded again."""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]


def as_jpeg(image: Image, quality: int) -> Image:
    """The image, (rows, columns, 3), BGR, after JPEG of quality 1 to 100: 8x8 blocks, colour at half the resolution."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
