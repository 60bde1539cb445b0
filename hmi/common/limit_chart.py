"""Layout of limit charts: coordinates of all lines and ticks; `limit_chart.html.j2` draws them as SVG."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

WIDE, HIGH = 720.0, 330.0
LEFT, RIGHT, TOP, BOTTOM = 62.0, 18.0, 30.0, 46.0
STRIP_WIDE, STRIP_HIGH = 720.0, 96.0
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_TICKS = 6
_ROOM = 1.04
"""Beyond the largest value, so that its sign is not at the edge."""


class Curve(NamedTuple):
    """One fruit's area over closing."""

    kind: str
    """Its class: `pass`, `fail`, `none`, or `own` for the one that the chart is about."""
    points: Sequence[tuple[float, float]]
    """mm and mm²."""


class Limit(NamedTuple):
    """An area threshold of a recipe."""

    closing_mm: float
    area_mm2: float
    least_area_mm2: float


class Tick(NamedTuple):
    """A number beside an axis, and its position."""

    at: float
    value: float
    digits: int


class LimitMark(NamedTuple):
    """A threshold at its position."""

    x: float
    y: float
    least_y: float | None
    """None for no label."""
    limit: Limit


class AreaChart(NamedTuple):
    """Area over closing, in the drawing's units."""

    curves: tuple[tuple[str, str, tuple[tuple[float, float], ...]], ...]
    """Class, polyline, and where the points are to be marked."""
    marks: tuple[LimitMark, ...]
    early_y: float | None
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]


class StripLine(NamedTuple):
    """A limit of a strip."""

    x: float
    value: float
    kind: str
    """`limit` or `early`."""


class Strip(NamedTuple):
    """One number of many fruit on a line, with the recipe's limits."""

    dots: tuple[tuple[str, float, float], ...]
    """Class, x and y; those that lie on each other are spread."""
    lines: tuple[StripLine, ...]
    ticks: tuple[Tick, ...]


def area_chart(curves: Sequence[Curve], limits: Sequence[Limit], early_stop_mm2: float | None) -> AreaChart:
    """Lay out areas over closing with a recipe's limits.

    Args:
        curves: drawn in this order; points of the curve `own` are marked.
        limits: in ascending order of closing.
        early_stop_mm2: the early stop's area; None for none.
    """
    xs = [x for curve in curves for x, _ in curve.points] + [limit.closing_mm for limit in limits]
    ys = [y for curve in curves for _, y in curve.points] + [limit.area_mm2 for limit in limits]
    x_ticks, x_most = _ticks(_ROOM * max(xs, default=1.0))
    y_ticks, y_most = _ticks(_ROOM * max([*ys, early_stop_mm2 or 0.0], default=1.0))

    def x_of(value: float) -> float:
        return round(LEFT + (WIDE - LEFT - RIGHT) * min(max(value, 0.0), x_most) / x_most, 1)

    def y_of(value: float) -> float:
        return round(HIGH - BOTTOM - (HIGH - TOP - BOTTOM) * min(max(value, 0.0), y_most) / y_most, 1)

    drawn = []
    for curve in curves:
        places = tuple((x_of(x), y_of(y)) for x, y in curve.points)
        drawn.append((curve.kind, " ".join(f"{x:g},{y:g}" for x, y in places), places if curve.kind == "own" else ()))
    marks = tuple(
        LimitMark(
            x_of(limit.closing_mm),
            y_of(limit.area_mm2),
            y_of(limit.least_area_mm2) if limit.least_area_mm2 > 0 else None,
            limit,
        )
        for limit in limits
    )
    return AreaChart(
        tuple(drawn),
        marks,
        None if early_stop_mm2 is None else y_of(early_stop_mm2),
        tuple(Tick(x_of(tick.value), tick.value, tick.digits) for tick in x_ticks),
        tuple(Tick(y_of(tick.value), tick.value, tick.digits) for tick in y_ticks),
    )


def strip(values: Iterable[tuple[str, float]], limits: Sequence[tuple[str, float]], *, from_zero: bool = True) -> Strip:
    """Lay one number of many fruit out on a line.

    Args:
        values: class and value of each fruit.
        limits: `limit` or `early`, and its value.
        from_zero: whether the line begins at 0; else a little below the smallest value.
    """
    known = list(values)
    every = [value for _, value in (*known, *limits)]
    least = 0.0 if from_zero else min(every, default=0.0)
    ticks, most = _ticks(_ROOM * max([*every, least + 1e-6], default=1.0), least)
    least = ticks[0].value

    def x_of(value: float) -> float:
        share = (min(max(value, least), most) - least) / (most - least)
        return round(LEFT + (STRIP_WIDE - LEFT - RIGHT) * share, 1)

    dots = tuple((kind, x_of(value), 26.0 + 7.0 * (number % 5)) for number, (kind, value) in enumerate(known))
    return Strip(
        dots,
        tuple(StripLine(x_of(value), value, kind) for kind, value in limits),
        tuple(Tick(x_of(tick.value), tick.value, tick.digits) for tick in ticks),
    )


def spark(areas_mm2: Sequence[float | None], wide: float = 96.0, high: float = 28.0) -> str:
    """Return a curve's points for a list's row, scaled from 0 to its largest area.

    Args:
        areas_mm2: in the order of the steps; those without an area are left out.
        wide: width of the picture.
        high: height of the picture.
    """
    largest = max((area for area in areas_mm2 if area is not None), default=0.0) or 1.0
    gap = wide / max(1, len(areas_mm2) - 1)
    return " ".join(
        f"{number * gap:.1f},{high - 2 - (high - 4) * max(0.0, area) / largest:.1f}"
        for number, area in enumerate(areas_mm2)
        if area is not None
    )


def histogram(counts: Sequence[int], wide: float = 256.0, high: float = 80.0) -> str:
    """Return the polygon of an image's histogram; heights are square roots, which keeps small bins visible.

    Args:
        counts: pixels a bin.
        wide: width of the picture.
        high: height of the picture.
    """
    largest = math.sqrt(max(counts, default=0)) or 1.0
    gap = wide / max(1, len(counts) - 1)
    tops = (f"{number * gap:.1f},{high - high * math.sqrt(count) / largest:.1f}" for number, count in enumerate(counts))
    return " ".join([f"0,{high:g}", *tops, f"{wide:g},{high:g}"])


def _ticks(most: float, least: float = 0.0) -> tuple[list[Tick], float]:
    """Return round numbers from at most the least to at least the most, and the last of them."""
    span = max(most - least, 1e-6)
    power = 10.0 ** math.floor(math.log10(span / _TICKS))
    step = next(step * power for step in _STEPS if step * power * _TICKS >= span * 0.999)
    digits = max(0, (1 if f"{step:e}".startswith("2.5") else 0) - math.floor(math.log10(step) + 1e-9))
    first, last = math.floor(least / step + 1e-9), math.ceil(most / step - 1e-9)
    values = [number * step for number in range(first, max(last, first + 1) + 1)]
    return [Tick(0.0, value, digits) for value in values], values[-1]
