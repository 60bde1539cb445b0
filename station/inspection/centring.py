"""Centring: where the sensor has to go so that a contact off the field's middle comes to it."""

from math import hypot
from typing import NamedTuple


class Way(NamedTuple):
    """A way in the sensor's image, mm."""

    right_mm: float = 0.0
    down_mm: float = 0.0

    @property
    def length_mm(self) -> float:
        """Length of the way, mm."""
        return hypot(self.right_mm, self.down_mm)

    def then(self, other: "Way") -> "Way":
        """One way after the other."""
        return Way(self.right_mm + other.right_mm, self.down_mm + other.down_mm)


NOT_MOVED = Way()


def off_middle(centroid_px: tuple[float, float], shape: tuple[int, ...], mm_per_px: float) -> Way:
    """From the middle of an image, height and width in px, to a contact's centroid, x and y in px."""
    (x_px, y_px), (height_px, width_px) = centroid_px, shape[:2]
    return Way(mm_per_px * (x_px - (width_px - 1) / 2), mm_per_px * (y_px - (height_px - 1) / 2))


def too_far(off: Way, moved: Way, most_mm: float) -> bool:
    """Return whether a contact off the middle is further than `most_mm` from the sensor's taught place."""
    return moved.then(off).length_mm > most_mm
