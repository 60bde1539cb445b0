"""Strip chart: one number of many fruit on a line, with the recipe's limits; `strip.html.j2` draws it."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from station.charts.axis import Axis

LEFT, RIGHT = 62.0, 702.0
"""Ends of the line in the drawing, which is 720 wide."""
_ROOM = 1.04
"""Beyond the largest value, so that its sign is not at the edge."""


class Tick(NamedTuple):
    """A number at its position."""

    at: float
    value: float
    digits: int


class StripLine(NamedTuple):
    """A limit."""

    x: float
    kind: str
    """`limit` or `early`."""


class Strip(NamedTuple):
    """The drawing."""

    dots: tuple[tuple[str, float, float], ...]
    """Class, x and y; those that lie on each other are spread."""
    lines: tuple[StripLine, ...]
    ticks: tuple[Tick, ...]


def strip(values: Iterable[tuple[str, float]], limits: Sequence[tuple[str, float]]) -> Strip:
    """Lay a number of many fruit, with their class, out on a line from 0, with its `limit` and `early` lines."""
    known = list(values)
    largest = max((value for _, value in (*known, *limits)), default=1.0)
    x = Axis(0.0, _ROOM * largest, LEFT, RIGHT, 6)
    return Strip(
        tuple((kind, x(value), 26.0 + 7.0 * (number % 5)) for number, (kind, value) in enumerate(known)),
        tuple(StripLine(x(value), kind) for kind, value in limits),
        tuple(Tick(x(tick.value), tick.value, tick.digits) for tick in x.ticks),
    )
