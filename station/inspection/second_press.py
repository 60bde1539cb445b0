"""Second press: when an inconclusive fruit is worth another press, and how two presses on it are judged together."""

from collections.abc import Sequence
from dataclasses import replace

from station.inspection.evidence import AT_MM, EXCUSABLE, LOWER_BOUNDS
from station.inspection.judge import Judgement
from station.inspection.press import Measured, Press
from station.vocabulary import Flag, Reason

PRESS_AGAIN_AT = frozenset(
    {Reason.CUT_BY_BORDER, Reason.LOW_CONFIDENCE, Reason.SATURATED, Reason.AREA_NOT_RISING, Reason.NEAR_LIMIT}
)
"""Reasons of the measurement, for which another press may show what this one did not."""

FREED_BY_MM = 2.0
"""So much wider than where a fruit was met the jaws open before the sensor moves beside it and closes again: room for
one that rolled."""

_PER_SPREAD = 10.0
"""Two presses agree by one half where their areas spread by a tenth, as the frames of a step do
(`station.vision.confidence`)."""


def needs_second_press(verdict: Judgement) -> bool:
    """Return whether another press may decide an inconclusive fruit; it cannot decide a fault or an impossible size."""
    return verdict.outcome == "NO_RESULT" and set(verdict.reasons) <= PRESS_AGAIN_AT | {Reason.EARLY_STOP}


def together(presses: Sequence[Press]) -> Press:
    """One or more presses, in order, on one fruit as one: at each closing the mean of what is trusted, else the last's.

    What differs from fruit to fruit is the same in both, so the uncertainty is no smaller for the mean. An area that is
    a lower bound in one press is one in the other: the fruit is never judged by less. Two areas whose edges are both
    weak in the noise count as the larger one, with the confidence that both give together.

    Returns:
        The last one, with its onset and as far as it has come, and these areas.
    """
    *earlier, last = presses
    for before in earlier:
        last = replace(last, points=tuple(_with(point, before.points) for point in last.points))
    return last


def _with(point: Measured, earlier: Sequence[Measured]) -> Measured:
    """A point with what an earlier press showed at the same closing."""
    other = next((each for each in earlier if abs(each.closing_mm - point.closing_mm) <= AT_MM), None)
    if other is None:
        return point
    if point.flags or other.flags:
        trusted, doubtful = (replace(other, closing_mm=point.closing_mm), point) if point.flags else (point, other)
        if trusted.flags:
            return _of_weak_edges(point, other)
        is_bound = doubtful.flags <= LOWER_BOUNDS and doubtful.area_mm2 > trusted.area_mm2
        return replace(trusted, area_mm2=doubtful.area_mm2, area_px=doubtful.area_px) if is_bound else trusted
    mean_mm2, mean_px = (point.area_mm2 + other.area_mm2) / 2, (point.area_px + other.area_px) // 2
    return replace(point, area_mm2=mean_mm2, area_px=mean_px)


def _of_weak_edges(point: Measured, other: Measured) -> Measured:
    """Two doubtful points as one where nothing but the edge's weakness speaks against either; else the later one.

    A confidence is q²/(q² + k²) of the edge's signal to noise q. Two presses have their own noise each, so their q² add
    up, and with them the odds c/(1 - c). Areas that differ take off from that. The judge compares the sum with the
    recipe's least confidence as it does with any.
    """
    doubts = point.flags | other.flags
    if not doubts <= EXCUSABLE or Flag.LOW_CONFIDENCE not in point.flags & other.flags:
        return point
    one, two = point.confidence or 0.0, other.confidence or 0.0
    # A confidence of 0 adds nothing, and the odds of two that are 1 have no sum.
    if not 0 < one * two < 1 or not point.area_mm2 * other.area_mm2:
        return point
    both = (one + two - 2 * one * two) / (1 - one * two)  # the odds added, as a confidence again
    spread = abs(point.area_mm2 - other.area_mm2) / (point.area_mm2 + other.area_mm2)
    # A contact whose edge is weak is measured too small rather than too large.
    larger = max(point, other, key=lambda each: each.area_mm2)
    return replace(
        point,
        area_mm2=larger.area_mm2,
        area_px=larger.area_px,
        confidence=both / (1 + _PER_SPREAD * spread),
        # The flags are each press's own; the judge doubts both together by their confidence alone.
        flags=frozenset[Flag](),
    )
