"""From pixels to square millimetres, with what is not known about the scale."""

from dataclasses import dataclass
from math import sqrt

from station.vision.working import PRINTED_LONG_SIDE_PX

TYPICAL_MM_PER_PX = 0.0266
"""At 640 pixels along the longer side: the middle of what is published for single DIGIT units, 0.0255 to 0.0291."""

TYPICAL_UNCERTAINTY = 0.15
"""Relative, of a length: covers the published units and the field's distortion; an area is good to about 30 %."""

TYPICAL_STANDARD_UNCERTAINTY = TYPICAL_UNCERTAINTY / sqrt(3)
"""Its standard uncertainty: a rectangular distribution of the units' scales over the published range (GUM 4.3.7)."""


@dataclass(frozen=True, slots=True)
class Scale:
    """The size of a pixel on the gel."""

    mm_per_px: float
    uncertainty: float
    """Relative, of a length; an area's is twice that."""

    @classmethod
    def typical(cls, height_px: int, width_px: int) -> "Scale":
        """The scale of a unit that has not been calibrated, for an image of the whole field.

        Raises:
            ValueError: a side is not positive.
        """
        if height_px <= 0 or width_px <= 0:
            raise ValueError(f"an image of {width_px} x {height_px} px has no scale: both sides must be positive")
        return cls(TYPICAL_MM_PER_PX * PRINTED_LONG_SIDE_PX / max(height_px, width_px), TYPICAL_UNCERTAINTY)

    def area_mm2(self, area_px: float) -> tuple[float, float]:
        """An area in pixels, and its uncertainty, both in mm²."""
        area = area_px * self.mm_per_px**2
        return area, 2 * self.uncertainty * area
