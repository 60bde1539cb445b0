"""The measurement methods by their names in a recipe."""

from station.settings.segmentation import Segmentation
from station.vision.contact import Image, Method
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod


def make_method(reference: Image, segmentation: Segmentation) -> Method:
    """Make a recipe's method for one thread's use.

    Args:
        reference: the untouched gel, shape (height, width, 3), dtype uint8, BGR; of several frames their median.
        segmentation: the recipe's.

    Raises:
        ValueError: the reference is no such image.
    """
    match segmentation.method:
        case "paper":
            return PaperMethod(reference, segmentation.paper)
        case "robust":
            return RobustMethod(reference, segmentation.robust)
