"""The area curve: contact area over closing, one point per width step."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reading:
    """A contact area measured at a gripper width."""

    width_mm: float
    """The measured width, never the commanded one."""
    area_px: int
    area_mm2: float
    counts: bool
    """Whether closing may be counted from it: not from a light touch, nor where nothing touches."""


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One point of an area curve."""

    closing_mm: float
    """Onset minus width; negative before the first contact."""
    reading: Reading


@dataclass(frozen=True, slots=True)
class AreaCurve:
    """The readings of one press in the order in which the gripper closed."""

    onset_mm: float | None
    """The width of the first contact; None where nothing was touched."""
    points: tuple[CurvePoint, ...]
    """Empty where nothing was touched, since closing is counted from the onset."""


def area_curve(readings: Iterable[Reading]) -> AreaCurve:
    """Order the readings by falling width and count the closing from the first contact.

    Readings at one width keep their order.

    Returns:
        The curve; the closing is the paper's "width difference" (Computers and Electronics in Agriculture 235
        (2025) 110397).
    """
    closing_order = sorted(readings, key=lambda reading: -reading.width_mm)
    onset_mm = next((reading.width_mm for reading in closing_order if reading.counts), None)
    if onset_mm is None:
        return AreaCurve(None, ())
    return AreaCurve(onset_mm, tuple(CurvePoint(onset_mm - reading.width_mm, reading) for reading in closing_order))
