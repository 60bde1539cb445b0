"""The measurement methods by their names in a recipe."""

from collections.abc import Sequence

from station.settings.segmentation import Segmentation
from station.vision.contact import Image, Method
from station.vision.median import median_image
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod


def make_method(references: Sequence[Image], segmentation: Segmentation) -> Method:
    """Make a recipe's method for one thread's use, from one or more images of one shape of the untouched gel.

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
