"""The measurement methods by their names in a recipe."""

from collections.abc import Sequence

import numpy as np

from station.settings.segmentation import Segmentation
from station.vision.contact import Image, Method
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod


def make_method(references: Sequence[Image], segmentation: Segmentation) -> Method:
    """Make the method that a recipe names, for one thread's use.

    Args:
        references: one or more images of the untouched gel, of one shape (height, width, 3), dtype uint8.
        segmentation: the method and its parameters.

    Raises:
        ValueError: there is no reference, or the references differ in shape.
    """
    if len({reference.shape for reference in references}) != 1:
        raise ValueError("expected one or more reference images of one shape")
    match segmentation.method:
        case "paper":
            return PaperMethod(median_image(references), segmentation.paper)
        case "robust":
            return RobustMethod(references, segmentation.robust)


def median_image(images: Sequence[Image]) -> Image:
    """The median of several images, pixel by pixel and colour by colour.

    Args:
        images: one or more, of one shape, dtype uint8.
    """
    return images[0] if len(images) == 1 else np.median(np.stack(images), axis=0).astype(np.uint8)
