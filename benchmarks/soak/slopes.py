"""Slope of a series with an interval that its own memory widens: whether something grows can be decided, or not yet."""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy.stats import norm, rankdata

CONFIDENCE = 0.95
FEWEST = 8
"""Of points: with fewer the normal approximation of Kendall's statistic does not hold (Gilbert 1987, section 16.4)."""


class Verdict(StrEnum):
    """Decision of a slope's interval about a limit."""

    YES = "yes"
    NO = "no"
    UNDECIDED = "not decided"


class Slope(NamedTuple):
    """A rise for each hour, and the interval that holds the true one."""

    per_hour: float
    low: float
    high: float

    def below(self, limit: float) -> Verdict:
        """Return whether the true slope is below a limit, per hour; `UNDECIDED` if the interval contains it."""
        if self.high < limit:
            return Verdict.YES
        return Verdict.NO if self.low >= limit else Verdict.UNDECIDED


def slope(at_s: Sequence[float], values: Sequence[float]) -> Slope | None:
    """Return the median of all pairs' slopes (Theil, Sen), and its interval; None for fewer than `FEWEST` points.

    Sen's interval (1968) takes the points as independent. Memory is not: it rises by steps and remains there, so the
    variance of Kendall's statistic is multiplied as by Hamed and Rao (Journal of Hydrology 204, 1998), by the
    autocorrelation of the detrended values' ranks. Only its lags before the first insignificant one count (Geyer 1992):
    the sum over all lags of a series is -1/2, for any series.

    Args:
        at_s: times.
        values: one for each time.
    """
    if len(values) < FEWEST:
        return None
    hours, heights = np.asarray(at_s) / 3600, np.asarray(values, dtype=float)
    first, second = np.triu_indices(len(heights), 1)
    slopes = np.sort((heights[second] - heights[first]) / (hours[second] - hours[first]))
    middle = float(np.median(slopes))
    deviation = np.sqrt(_kendall_variance(heights) * _variance_factor(heights - middle * hours))
    half = float(norm.ppf((1 + CONFIDENCE) / 2)) * deviation / 2
    places = (int(np.floor(len(slopes) / 2 - half)), int(np.ceil(len(slopes) / 2 + half)))
    low, high = (float(slopes[min(max(place, 0), len(slopes) - 1)]) for place in places)
    return Slope(middle, min(low, middle), max(high, middle))


def _kendall_variance(values: np.ndarray) -> float:
    """The variance of Kendall's statistic of independent values; equal ones lower it."""
    number = len(values)
    ties = np.unique(values, return_counts=True)[1]
    return float(number * (number - 1) * (2 * number + 5) - (ties * (ties - 1) * (2 * ties + 5)).sum()) / 18


def _variance_factor(residuals: np.ndarray) -> float:
    """By how much dependence multiplies that variance; never below 1."""
    number = len(residuals)
    ranks = rankdata(residuals) - (number + 1) / 2
    power = float(ranks @ ranks)
    if not power:
        return 1.0
    total = 0.0
    for lag in range(1, number - 2):
        correlation = float(ranks[lag:] @ ranks[:-lag]) / power
        if correlation < norm.ppf((1 + CONFIDENCE) / 2) / np.sqrt(number):
            break
        total += (number - lag) * (number - lag - 1) * (number - lag - 2) * correlation
    return 1 + 2 * total / (number * (number - 1) * (number - 2))
