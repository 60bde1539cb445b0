"""Calibration figures, computed from frames, steps and places."""

from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Literal, NamedTuple

import cv2
import numpy as np

from station.calibration.model import FieldMap, Levels, Noise, PlacePoint, PressPoint
from station.vision.contact import Contact, Image

FIELD_ROWS, FIELD_COLUMNS = 16, 12
"""Cells of the field map, 40 px square in an image of 640x480. A resolution."""
QUIET_GATE = 0.8
"""Largest value of the gate's statistic with nothing touching, after the unit's factor."""
_CENTROID_PX = 1.0
"""Two standard deviations of a centroid in repeats on the twin."""
_STEP_MM = 0.5
"""Half a width step of the ball's recipe: a width that the gripper meets this far beyond a limit still counts."""


def noise(frames: Sequence[Image], untouched: Sequence[Contact]) -> Noise:
    """Measure the noise of three or more frames of one shape, and of the method's contacts, with nothing touching."""
    gate = max((contact.gate or 0.0 for contact in untouched), default=0.0)
    return Noise(
        pixel_levels=_by_colour(pixel_noise(frames).mean(axis=(0, 1))),
        gate=round(gate, 3),
        # At least 1: a quiet unit does not become more sensitive than what was tested.
        gate_factor=round(max(1.0, gate / QUIET_GATE), 3),
        drift_levels=round(max((contact.drift_levels or 0.0 for contact in untouched), default=0.0), 2),
    )


def pixel_noise(frames: Sequence[Image]) -> np.ndarray:
    """Return each pixel's standard deviation over three or more frames of one shape, without changes of whole frames.

    Returns:
        Shape (height, width, 3), dtype float32, grey levels.
    """
    # Sums of differences to the first frame: those of whole grey levels are large, and float32 would round off part of
    # the small variance, which is their difference.
    total, squares = (np.zeros(frames[0].shape, np.float32) for _ in range(2))
    first = frames[0].astype(np.float32)
    for frame in frames:
        level = frame.astype(np.float32) - first
        level -= level.mean(axis=(0, 1))
        total += level
        squares += level**2
    number = len(frames)
    # Rounding may leave a variance slightly below 0.
    return np.sqrt(np.maximum(0.0, (squares - total**2 / number) / (number - 1)))


def field_map(reference: Image, frames: Sequence[Image]) -> FieldMap:
    """Map light and noise over the field. One ball at a few places gives no scale in between."""
    size = (FIELD_COLUMNS, FIELD_ROWS)
    light = cv2.resize(reference.astype(np.float32), size, interpolation=cv2.INTER_AREA).reshape(-1, 3)
    spread = cv2.resize(pixel_noise(frames).max(axis=2), size, interpolation=cv2.INTER_AREA)
    return FieldMap(
        rows=FIELD_ROWS,
        columns=FIELD_COLUMNS,
        light_levels=tuple(_by_colour(cell) for cell in light),
        noise_levels=tuple(round(float(level), 2) for level in spread.ravel()),
    )


class MeasuredScale(NamedTuple):
    """A scale from known distances."""

    mm_per_px: float
    uncertainty: float
    """Relative, about two standard deviations: the places' tolerance, the centroids' noise, and how far the distances
    disagree, which takes in the lens's distortion."""


def scale_of(places: Sequence[PlacePoint], tolerance_mm: float) -> MeasuredScale:
    """Compute the scale from the motion of the ball's contact in the image between two or more different places.

    Distances are compared, so the direction of the places' axes in the image does not matter.
    """
    ways_mm, ways_px = [], []
    for one, other in combinations(places, 2):
        ways_mm.append(float(np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm)))
        ways_px.append(
            float(np.hypot(one.centroid_x_px - other.centroid_x_px, one.centroid_y_px - other.centroid_y_px))
        )
    # Contacts that coincide must not divide by 0; the scale that they give is refused by the checks.
    mm, px = np.asarray(ways_mm), np.maximum(np.asarray(ways_px), 1e-6)
    # Least squares through the origin: the longer distances, which are relatively surer, weigh more.
    mm_per_px = float(mm @ px / (px @ px))
    disagreement = 2 * float(np.sqrt(np.mean((mm - mm_per_px * px) ** 2))) / float(mm.mean())
    known = tolerance_mm / float(mm.mean())
    # A distance has the noise of two centroids.
    seen = _CENTROID_PX * float(np.sqrt(2.0)) / float(px.mean())
    return MeasuredScale(mm_per_px, float(np.sqrt(disagreement**2 + known**2 + seen**2)))


def falls(curve: Sequence[PressPoint]) -> tuple[PressPoint, PressPoint] | None:
    """Return the first neighbours of a curve, from its contact on, between which the area does not rise, or None."""
    return next(((one, other) for one, other in pairwise(curve) if other.area_px <= one.area_px), None)


def judged(curve: Sequence[PressPoint], onset_mm: float, closing_mm: float) -> list[PressPoint]:
    """Return the steps from the contact onset on by which a ball is judged, in order of closing.

    Args:
        curve: in any order.
        onset_mm: width of the contact onset.
        closing_mm: limit up to which the ball's area is reliable; beyond it the border cuts the contact.
    """
    within = [point for point in curve if onset_mm - closing_mm - _STEP_MM <= point.width_mm <= onset_mm]
    return sorted((point for point in within if not point.cut), key=lambda point: -point.width_mm)


def ratio(
    curve: Sequence[PressPoint], golden: Sequence[PressPoint], what: Literal["area_px", "contrast_levels"]
) -> float | None:
    """Return the median ratio of areas or contrasts to an interpolated earlier curve's; None without common widths."""
    known = sorted((point.width_mm, getattr(point, what)) for point in golden if point.area_px)
    if len(known) < 2:
        return None
    widths, values = zip(*known, strict=True)
    ratios = [
        getattr(point, what) / float(np.interp(point.width_mm, widths, values))
        for point in curve
        if point.area_px and widths[0] - _STEP_MM <= point.width_mm <= widths[-1] + _STEP_MM
    ]
    # The median, so that one wrong step of the few does not decide.
    return round(float(np.median(ratios)), 4) if ratios else None


def roundness(contact: Contact) -> float:
    """Return the ratio of a contact's longer to its shorter axis; 1 for a ball's, 0 without a contact."""
    moments = cv2.moments(contact.mask, binaryImage=True)
    if not moments["m00"]:
        return 0.0
    spread = np.array([[moments["mu20"], moments["mu11"]], [moments["mu11"], moments["mu02"]]])
    shorter, longer = np.linalg.eigvalsh(spread)
    # The spread goes with the square of an axis; across a contact one pixel wide there is none.
    return float(np.sqrt(longer / max(shorter, 1e-9)))


def _by_colour(levels: np.ndarray) -> Levels:
    blue, green, red = (round(float(level), 2) for level in levels)
    return blue, green, red
