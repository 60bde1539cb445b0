"""Failure definition of a sample. The paper gives no definition in numbers."""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from station.studies.cohort import STEP_MM

LARGEST_FALL = 0.10
"""Share of its running maximum by which the area may fall. An estimate."""
LARGEST_ERROR = 0.50
"""Share of the true area by which the area may be wrong at a result's closing. An estimate."""

DEFINITION = (
    "A sample counts as failed when no contact is found in any of its images; or when the area, from the first image "
    f"with contact on, falls by more than {LARGEST_FALL:.0%} of its running maximum; or when the area is wrong by more "
    f"than {LARGEST_ERROR:.0%} against the truth in an image at one of the results' closings. An area that the method "
    "calls unknown counts as 0."
)


class Cause(StrEnum):
    """Cause of a sample's failure."""

    NO_CONTACT = "no_contact"
    FALLING_AREA = "falling_area"
    WRONG_AREA = "wrong_area"


def failures(
    closings_mm: Sequence[float],
    areas: Sequence[float],
    true_areas: Sequence[float],
    result_closings_mm: Sequence[float],
    *,
    from_mm: float | None = None,
) -> frozenset[Cause]:
    """Judge one sample by the study's definition.

    Args:
        closings_mm: true closing of each image, in ascending order.
        areas: measured, any unit, 0 for no contact.
        true_areas: in the same unit.
        result_closings_mm: closings of the results; the nearest image counts.
        from_mm: leave out the images more than half a step before this closing; None: all count.

    Returns:
        All causes that apply; empty for a sample that did not fail.
    """
    closings = np.asarray(closings_mm, float)
    measured, truth = np.asarray(areas, float), np.asarray(true_areas, float)
    counted = measured if from_mm is None else measured[closings >= from_mm - STEP_MM / 2]
    if not (counted > 0).any():
        return frozenset({Cause.NO_CONTACT})
    found = counted[int(np.argmax(counted > 0)) :]
    causes: set[Cause] = set()
    if (found < (1.0 - LARGEST_FALL) * np.maximum.accumulate(found)).any():
        causes.add(Cause.FALLING_AREA)
    at_results = image_at(closings_mm, result_closings_mm)
    if (np.abs(measured[at_results] - truth[at_results]) > LARGEST_ERROR * truth[at_results]).any():
        causes.add(Cause.WRONG_AREA)
    return frozenset(causes)


def image_at(closings_mm: Sequence[float], result_closings_mm: Sequence[float]) -> list[int]:
    """Return the image nearest to each of the results' closings."""
    closings = np.asarray(closings_mm, float)
    return [int(np.argmin(np.abs(closings - wanted))) for wanted in result_closings_mm]
