"""One press as it was measured: what the judge is given, in plain values."""

from dataclasses import dataclass
from math import isfinite

from station.inspection.fruit_size import NO_SIZE, FruitSize
from station.vocabulary import Flag, Reason

FINEST_STEP_MM = 0.4
"""A step that surely moves the gripper by one count, which is 85 mm / 227 = 0.37 mm on a 2F-85."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One measured width step."""

    closing_mm: float
    """Onset minus the measured width; negative before the first contact."""
    area_mm2: float
    area_px: int
    confidence: float | None
    """0 to 1; None where the method does not say, which is no trust."""
    flags: frozenset[Flag] = frozenset()
    changed_area_mm2: float | None = None
    """Area in which the image differs from the reference; None where the method does not measure it. The judge does not
    use it."""
    changed_area_px: int | None = None
    area_scatter_mm2: float = 0.0
    """How far the areas of steps that share this closing differ; `area_mm2` is the largest of them."""

    def __post_init__(self) -> None:
        changed = (self.changed_area_mm2 or 0.0, self.changed_area_px or 0)
        sizes = (self.area_mm2, self.area_px, self.area_scatter_mm2, self.confidence or 0.0, *changed)
        if not isfinite(self.closing_mm) or not all(isfinite(size) and size >= 0 for size in sizes):
            raise ValueError(f"expected finite values, and sizes that are not negative, got {self}")


@dataclass(frozen=True, slots=True)
class Press:
    """One inspection's measured steps."""

    onset_mm: float | None
    """The measured gripper width at first contact, so the fruit's width; None where nothing was touched."""
    onset_uncertainty_mm: float | None
    """How much sooner the contact may have started: from the last image without it to the first with it. None where
    every image shows a contact: then it may have started anywhere, and no closing is known."""
    points: tuple[Measured, ...]
    """In any order."""
    interruptions: tuple[Reason, ...] = ()
    """What ended the steps or spoilt them from outside the measurement: a fault, called off, late, a bad reference."""
    size: FruitSize = NO_SIZE
    """The fruit's size as the PLC gave it."""
    resolution_mm: float = 0.0
    """Of the measured widths: one count of the gripper, mm."""
    scale_uncertainty: float = 0.0
    """Relative standard uncertainty of the unit's mm per px, from its calibration."""
