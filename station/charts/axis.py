"""Axis of a chart: round numbers to label, and the position of each value."""

import math
from typing import NamedTuple

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_LEAST_SPAN = 1e-6
_ROUNDING = 1e-9
"""Relative: what floating-point numbers may differ by that are meant to be equal."""


class Tick(NamedTuple):
    """A labelled value."""

    value: float
    digits: int
    """Behind the decimal sign, as many as the step needs."""


def ticks(least: float, most: float, intervals: int) -> tuple[Tick, ...]:
    """Return evenly spaced round numbers, from at most the least to at least the most.

    Args:
        least: 0 gives an axis from 0 on.
        most: the value to reach.
        intervals: upper limit of their number; one more where both ends lie between two round numbers.
    """
    span = max(most - least, _LEAST_SPAN)
    power = 10.0 ** math.floor(math.log10(span / intervals))
    step = next(step * power for step in _STEPS if step * power * intervals >= span * (1 - _ROUNDING))
    digits = max(0, (1 if f"{step:e}".startswith("2.5") else 0) - math.floor(math.log10(step) + _ROUNDING))
    first, last = math.floor(least / step + _ROUNDING), math.ceil(most / step - _ROUNDING)
    return tuple(Tick(number * step, digits) for number in range(first, max(last, first + 1) + 1))


class Axis:
    """Scale from values to positions; a value beyond an end has that end's position.

    Args:
        least: the smallest value.
        most: the largest value; the axis ends at the next round number.
        begin: position of the axis's first tick.
        end: position of its last tick.
        intervals: as for `ticks`.
    """

    def __init__(self, least: float, most: float, begin: float, end: float, intervals: int) -> None:
        self.ticks = ticks(least, most, intervals)
        self._least, self._most = self.ticks[0].value, self.ticks[-1].value
        self._begin, self._end = begin, end

    def __call__(self, value: float) -> float:
        """Return a value's position."""
        share = (min(max(value, self._least), self._most) - self._least) / (self._most - self._least)
        return round(self._begin + share * (self._end - self._begin), 1)
