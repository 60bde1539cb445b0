"""Frames spoiled on their way out of the sensor, as VGA sensors and USB spoil them."""

import numpy as np

from station.twin.digit.codec import Image
from station.twin.faults import FaultBoard

FRAME_FAULTS = ("frame_torn", "frame_shifted", "frame_black", "frame_saturated")


def spoiled(image: Image, faults: FaultBoard, sequence: int) -> Image:
    """The frame as the faults leave it.

    The sensor reads out landscape rows, which are the portrait image's columns: a tear runs down the image with
    what is beyond it displaced along the columns, and a lost beginning rolls the whole image.

    Args:
        image: shape (640, 480, 3), dtype uint8.
        faults: those of `station.twin.digit.server.digit_faults`.
        sequence: the frame's number, which decides where it tears.
    """
    if not any(faults.active(fault) for fault in FRAME_FAULTS):
        return image
    height, width = image.shape[:2]
    generator = np.random.default_rng([sequence, 6])
    if faults.active("frame_torn"):
        place, displaced = int(generator.integers(width // 5, 4 * width // 5)), int(generator.integers(60, height - 60))
        image = np.hstack([image[:, :place], np.roll(image[:, place:], displaced, axis=0)])
    if faults.active("frame_shifted"):
        image = np.roll(image, int(generator.integers(40, height - 40)), axis=0)
    if faults.active("frame_black"):
        image = (image // 40).astype(np.uint8)
    if faults.active("frame_saturated"):
        image = np.minimum(255, image.astype(np.uint16) * 6 + 120).astype(np.uint8)
    return image
