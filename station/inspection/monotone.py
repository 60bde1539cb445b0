"""The area over a press as a sequence: while the gripper closes, a contact cannot shrink beyond noise.

Frames that break this are named, never corrected: what is not measured is not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


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
    widths_mm: Sequence[float], areas: Sequence[float], relative_noise: float = 0.05, least_noise: float = 0.0
) -> list[WrongFrame]:
    """The fewest frames without which the area never shrinks, within noise, while the width does.

    The longest run of frames that fit each other is kept (longest non-decreasing subsequence with a tolerance) and
    the rest is named. Of two runs of one length the one with the later frames is kept, since onset frames are the
    least certain. Opening again starts nothing new: only frames narrower than all before them are judged.

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
    closing = [i for i, width in enumerate(widths_mm) if i == 0 or width < min(widths_mm[:i])]
    values = [areas[i] for i in closing]
    slack = [max(least_noise, relative_noise * value) for value in values]
    kept = _longest_run(values, slack)
    wrong: list[WrongFrame] = []
    for place, index in enumerate(closing):
        if place not in kept:
            before = [values[k] - slack[k] for k in kept if k < place]
            after = [values[k] + slack[k] for k in kept if k > place]
            low, high = max(before, default=0.0), min(after, default=float("inf"))
            wrong.append(WrongFrame(index, float(values[place]), float(low), float(high)))
    return wrong


def _longest_run(values: list[float], slack: list[float]) -> set[int]:
    """Places of the longest run in which no value falls below the largest before it by more than that one's slack."""
    best: list[list[int]] = []
    for place, value in enumerate(values):
        runs = [run for run in best if value >= max(values[k] - slack[k] for k in run)]
        best.append([*max(runs, key=len, default=[]), place])
    return set(max(reversed(best), key=len, default=[]))
