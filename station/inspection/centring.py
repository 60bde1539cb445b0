"""Centring: offset of a contact from the field's middle, and the move of the sensor that removes it."""

from math import hypot
from typing import NamedTuple


class Offset(NamedTuple):
    """Offset in the sensor's image, mm."""

    right_mm: float = 0.0
    down_mm: float = 0.0

    @property
    def length_mm(self) -> float:
        """Length of the offset, mm."""
        return hypot(self.right_mm, self.down_mm)

    def then(self, other: "Offset") -> "Offset":
        """Return the sum of two offsets."""
        return Offset(self.right_mm + other.right_mm, self.down_mm + other.down_mm)


NOT_MOVED = Offset()


def off_middle(centroid_px: tuple[float, float], shape: tuple[int, ...], mm_per_px: float) -> Offset:
    """Return a contact's offset: its centroid, x and y in px, from the middle of an image, height and width in px."""
    (x_px, y_px), (height_px, width_px) = centroid_px, shape[:2]
    # The centroid is counted from the middle of the upper left pixel, so the last pixel's middle is at the width - 1.
    return Offset(mm_per_px * (x_px - (width_px - 1) / 2), mm_per_px * (y_px - (height_px - 1) / 2))


def too_far(off: Offset, moved: Offset, most_mm: float) -> bool:
    """Return whether a contact off the middle is further than `most_mm` from the sensor's taught place."""
    return moved.then(off).length_mm > most_mm
