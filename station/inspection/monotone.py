"""The area over a press as a sequence: while the gripper closes, a contact cannot shrink beyond noise.

Frames that break this are named, never corrected: what is not measured is not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RELATIVE_NOISE = 0.05
"""By how much of itself an area may fall while the gripper closes before its step is called wrong: an estimate, over
the method's median error on smooth bodies (docs/measurement.md). The guard band of a limit is in uncertainty.py."""


@dataclass(frozen=True, slots=True)
class WrongFrame:
    """A frame whose area does not fit the others'."""

    index: int
    area: float
    expected_low: float
    """The least that the steps before it allow."""
    expected_high: float
    """The most that the steps after it allow."""


def wrong_frames(
    widths_mm: Sequence[float],
    areas: Sequence[float],
    relative_noise: float = RELATIVE_NOISE,
    least_noise: float = 0.0,
) -> list[WrongFrame]:
    """The fewest frames without which the area never shrinks, within noise, while the width does.

    The longest run of frames that fit each other is kept (longest non-decreasing subsequence with a tolerance) and
    the rest is named. Of several of one length one that ends last is kept, since onset frames are the least certain,
    and of those the one with the earlier frames. Opening again starts nothing new: only frames narrower than all before
    them are judged.

    Args:
        widths_mm: measured gripper widths, in the order of the frames.
        areas: of the same frames, any unit.
        relative_noise: by which share of the area a frame may fall below an earlier one.
        least_noise: by which amount at least, in the areas' unit.

    Returns:
        In the order of the frames; empty where all fit.

    Raises:
        ValueError: the two differ in length, or a value is not finite.
    """
    if len(widths_mm) != len(areas):
        raise ValueError(f"{len(widths_mm)} widths and {len(areas)} areas: there must be one width for each area")
    if not (np.isfinite(widths_mm).all() and np.isfinite(areas).all()):
        raise ValueError("every width and area must be a finite number")
    closing = _narrower_than_before(widths_mm)
    values = np.array([areas[i] for i in closing], np.float64)
    slack = np.maximum(least_noise, relative_noise * values)
    kept = np.zeros(len(closing), np.bool_)
    kept[_longest_run(values, values - slack)] = True
    low = np.maximum.accumulate(np.where(kept, values - slack, -np.inf))
    high = np.minimum.accumulate(np.where(kept, values + slack, np.inf)[::-1])[::-1]
    return [
        WrongFrame(
            closing[place],
            float(values[place]),
            float(low[place]) if kept[:place].any() else 0.0,
            float(high[place]),
        )
        for place in np.flatnonzero(~kept)
    ]


def _narrower_than_before(widths_mm: Sequence[float]) -> list[int]:
    """Places whose width is below all widths before."""
    places: list[int] = []
    for place, width in enumerate(widths_mm):
        if not places or width < widths_mm[places[-1]]:
            places.append(place)
    return places


def _longest_run(values: npt.NDArray[np.float64], floors: npt.NDArray[np.float64]) -> list[int]:
    """Places of the longest run in which no value falls below the floor of one before it, in no order.

    Dynamic programming over the run's last place and its length, in quadratic time and memory where any value falls: of
    all runs of one length, a value that continues any of them continues the one with the lowest highest floor.
    """
    if (values[1:] >= np.maximum.accumulate(floors)[:-1]).all():
        return list(range(values.size))
    lowest = np.full(values.size + 1, np.inf)  # the lowest highest floor of the runs so far, by their length
    lowest[0] = -np.inf
    ending = np.full((values.size, values.size + 1), np.inf)  # likewise of those that end at a place
    for place, value in enumerate(values):
        ending[place, 1:] = np.where(value >= lowest[:-1], np.maximum(lowest[:-1], floors[place]), np.inf)
        lowest = np.minimum(lowest, ending[place])
    run, end, least_after = list[int](), values.size, values.max()
    for length in range(int(np.flatnonzero(lowest < np.inf)[-1]), 0, -1):
        fitting = np.flatnonzero(ending[:end, length] <= least_after)
        # The run's end as late as possible, as onset frames are the least certain; before it the earliest places.
        end = int(fitting[0] if run else fitting[-1])
        run.append(end)
        least_after = min(least_after, values[end])
    return run
