"""Limits for a wanted rate of false rejects, from fruit that a person found good, with what is unsure about them.

The judge passes a fruit where its area with the uncertainty on top keeps the limit (docs/decisions/0015), so that sum
is what is counted here. A limit is a quantile of it over the good fruit; its interval is between two order statistics,
which needs no assumption of a distribution (David and Nagaraja, Order Statistics, 3rd ed., 2003, section 7.1).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy import stats

from station.inspection.evidence import Evidence
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.settings.recipe_model import Recipe

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """Where a value lies with `CONFIDENCE`; None where the fruit are too few to say."""

    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Limit:
    """One proposed limit."""

    closing_mm: float | None
    """None for the growth."""
    good: tuple[float, ...]
    """Of the good fruit, mm² or mm²/mm, ascending."""
    bad: tuple[float, ...]
    unknown: int
    """Marked fruit whose curve does not tell the value."""
    value: float
    interval: Interval
    rate: float
    """The rate of false rejects that this limit alone was chosen for."""


def area_most_mm2(press: Press, recipe: Recipe, closing_mm: float) -> float | None:
    """The most that a fruit's area may be at a closing, as that of a fruit of the recipe's reference size.

    None where the closing was not reached, or the fruit's size is not known.

    Args:
        press: as stored.
        recipe: that it was pressed by.
        closing_mm: where.
    """
    limits = sized_limits(press, recipe)
    area = Evidence(press, limits).area_at(closing_mm)
    return None if area is None or limits.problem else sum(area) / limits.factor


def growth_most_mm2_per_mm(press: Press, recipe: Recipe) -> float | None:
    """The most that a fruit's steepest growth may be, as that of a fruit of the recipe's reference size.

    None with too few points, or where the fruit's size is not known.

    Args:
        press: as stored.
        recipe: that it was pressed by.
    """
    limits = sized_limits(press, recipe)
    growths = [] if limits.problem else [growth for growth in Evidence(press, limits).growths if not growth.few]
    return max((growth.most_mm2_per_mm / limits.factor for growth in growths), default=None)


def propose(
    good: Sequence[float | None], bad: Sequence[float | None], closing_mm: float | None, rate: float
) -> Limit | None:
    """The limit that rejects at most this share of good fruit.

    Args:
        good: of each good fruit; None where it is not known.
        bad: likewise of the bad.
        closing_mm: where; None for the growth.
        rate: the wanted rate of false rejects, above 0 and below 1.

    Returns:
        None where no good fruit tells anything.
    """
    known = sorted(value for value in good if value is not None)
    if not known:
        return None
    unknown = sum(value is None for value in (*good, *bad))
    place = min(len(known), math.ceil((1 - rate) * len(known)))
    known_bad = tuple(sorted(value for value in bad if value is not None))
    interval = quantile_interval(known, 1 - rate)
    return Limit(closing_mm, tuple(known), known_bad, unknown, known[place - 1], interval, rate)


def quantile_interval(ascending: Sequence[float], share: float) -> Interval:
    """Between which two of the values the share's quantile lies.

    Args:
        ascending: a sample.
        share: above 0 and below 1.
    """
    number, tail = len(ascending), (1 - CONFIDENCE) / 2
    low = int(stats.binom.ppf(tail, number, share))
    high = int(stats.binom.ppf(1 - tail, number, share)) + 1
    return Interval(ascending[low - 1] if low >= 1 else None, ascending[high - 1] if high <= number else None)


def rate_interval(happened: int, number: int) -> Interval:
    """Where a rate lies (Clopper and Pearson, Biometrika 26 (1934) 404).

    Args:
        happened: how often.
        number: of how many.
    """
    if not number:
        return Interval(None, None)
    found = stats.binomtest(happened, number).proportion_ci(CONFIDENCE, method="exact")
    return Interval(float(found.low), float(found.high))


def fewest_good(rate: float) -> int:
    """How many good fruit are needed for an interval's upper end to be known.

    Args:
        rate: the wanted rate of false rejects.
    """
    return math.ceil(math.log((1 - CONFIDENCE) / 2) / math.log(1 - rate))
