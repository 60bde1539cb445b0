"""The methods compared: the paper's as printed, the idea of PyTouch's contact area, and the station's own."""

from collections.abc import Callable

import cv2
import numpy as np

from station.settings.segmentation import PaperParameters, RobustParameters
from station.vision.contact import Image, Mask
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod

DARKER_COUNTS = 0.7
"""What PyTouch scales a difference below the reference by before it takes the size."""

PEER = "PyTouch's contact area"

Measure = Callable[[Image], Mask]


def contact_area_idea(reference: Image) -> Measure:
    """The idea of PyTouch's ContactArea, written from its description: scaled difference, box, threshold, ellipse."""
    base = reference.astype(np.float32)

    def measure(image: Image) -> Mask:
        signed = (image.astype(np.float32) - base) / 255
        scaled = np.where(signed < 0, -DARKER_COUNTS * signed, signed).mean(axis=2)
        inside = (cv2.boxFilter(scaled, -1, (64, 64)) > 0.04).astype(np.uint8)
        inside = cv2.erode(inside, np.ones((16, 16), np.uint8))
        mask = np.zeros(image.shape[:2], np.uint8)
        outlines, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        largest = max(outlines, key=cv2.contourArea, default=np.zeros((0, 1, 2), np.int32))
        if len(largest) >= 5:
            cv2.ellipse(mask, cv2.fitEllipse(largest), 255, cv2.FILLED)
        return mask

    return measure


def methods(reference: Image) -> dict[str, Measure]:
    """The methods compared, each prepared for a reference."""
    paper = PaperMethod(reference, PaperParameters())
    robust = RobustMethod(reference, RobustParameters())
    return {
        "`paper`, as printed": lambda image: paper.measure(image).mask,
        PEER: contact_area_idea(reference),
        "`robust`": lambda image: robust.measure(image).mask,
    }
