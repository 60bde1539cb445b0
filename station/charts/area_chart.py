"""Chart of contact area over closing as SVG, with a recipe's limits: the one that pages, reports and analyses show.

Its style sheet is `area_chart.css`: the pages serve the file, a report contains its text. A page sets other colours by
the custom properties that are named there.
"""

from collections.abc import Callable, Sequence
from math import ceil
from pathlib import Path
from typing import Literal, NamedTuple

from markupsafe import Markup, escape

from station.charts.axis import Axis

STYLE_FILE = Path(__file__).with_name("area_chart.css")
_REPORT_STYLE = Path(__file__).with_name("report.css")
_LEAST_SHOWN_MM2 = 0.05
"""Less is lost in the one digit behind the decimal sign."""
_ROOM = 1.04
"""Beyond the largest value, so that its sign is not at the edge."""
_PRESS_COLOURS = 7
"""In the style sheet; a further press has the first one's again."""
_PRESS_COLUMNS = 2
"""Of the legend of presses, as many as its texts allow."""

Mark = Literal["point", "decided", "doubtful", "bound", "wrong"]
"""Sign of one point: measured, the one that decided, doubtful, a lower bound, or one that does not fit the others."""
Kind = Literal["own", "again", "changed", "pass", "fail", "none"]
"""Of a curve: the one that the chart is about, the same measured again, its changed area, or another fruit's, by its
outcome."""


class Curve(NamedTuple):
    """One fruit's area over closing."""

    kind: Kind
    points: Sequence[tuple[float, float]]
    """mm and mm²."""
    marks: Sequence[Mark] = ()
    """Of the points, in order; none for a line without signs."""
    press: int = 0
    """Its number among several presses, from 1: written beside its end, and its colour. 0 for one alone."""


class Limit(NamedTuple):
    """An area threshold of a recipe."""

    closing_mm: float
    area_mm2: float
    least_area_mm2: float = 0.0
    """A smaller area is no sound contact; 0 for none."""
    former: bool = False
    """Of the recipe that is compared with."""


class Texts(NamedTuple):
    """The chart's texts, in one language."""

    label: str
    """What the chart shows, for who cannot see it."""
    closing: str = "closing, mm"
    area: str = "contact area, mm²"
    early_stop: str = "early stop"
    limit: str = "limit"
    """Before a limit's area, beside its sign."""
    onset: str = ""
    """Beside a line at closing 0; none if empty."""
    legend: Sequence[tuple[Kind | Mark, str]] = ()
    presses: Sequence[str] = ()
    """For the legend: each press's text, in the order of their numbers."""


class Size(NamedTuple):
    """Of the drawing, in its own units."""

    wide: int = 720
    high: int = 330
    text: int = 17


def style() -> Markup:
    """Return the chart's style sheet, for a report's own."""
    return Markup(STYLE_FILE.read_text(encoding="utf-8"))  # noqa: S704 (the project's own file)


def report_style() -> Markup:
    """Return the style sheet of a report in one file, with the chart's."""
    return Markup(_REPORT_STYLE.read_text(encoding="utf-8")) + style()  # noqa: S704 (the project's own file)


def plain(value: float, digits: int) -> str:
    """Format an axis's number in English."""
    return f"{value:.{digits}f}"


def area_chart(
    curves: Sequence[Curve],
    limits: Sequence[Limit],
    texts: Texts,
    *,
    early_stop_mm2: float | None = None,
    size: Size = Size(),  # noqa: B008 (immutable)
    number: Callable[[float, int], str] = plain,
) -> Markup:
    """Draw areas over closing with a recipe's limits.

    Args:
        curves: drawn in this order.
        limits: in ascending order of closing.
        texts: in the reader's language.
        early_stop_mm2: the early stop's area; None for none.
        size: of the plot; a legend is below it.
        number: formats a value with so many digits behind the decimal sign.
    """
    wide, high, text = size
    left, right, top, bottom = round(3.6 * text), wide - text, round(2.4 * text), round(high - 2.7 * text)
    closings = [x for curve in curves for x, _ in curve.points] + [limit.closing_mm for limit in limits]
    areas = [y for curve in curves for _, y in curve.points] + [limit.area_mm2 for limit in limits]
    furthest, largest = max(closings, default=1.0), max([*areas, early_stop_mm2 or 0.0], default=1.0)
    x = Axis(min([0.0, *closings]), _ROOM * furthest, left, right, max(2, round((right - left) / 6 / text)))
    y = Axis(0.0, _ROOM * largest, bottom, top, max(2, round((bottom - top) / 2.6 / text)))
    parts = [_axes(x, y, texts, size, number)]
    if texts.onset:
        at = x(0.0)
        parts.append(f'<path class="onset" d="M{at} {top}V{bottom}"/>')
        parts.append(f'<text x="{at + text / 3:.1f}" y="{top + text}">{escape(texts.onset)}</text>')
    parts += [_curve(curve, x, y, text) for curve in curves]
    parts.append(_press_numbers(curves, x, y, text))
    if early_stop_mm2 is not None:
        at = y(early_stop_mm2)
        parts.append(f'<path class="early" d="M{left} {at}H{right}"/>')
        words = escape(texts.early_stop)
        # At the left, where areas are small: the limits' own names are at the right.
        parts.append(f'<text class="limit-name" x="{left + text / 3:.1f}" y="{at - 5:.1f}">{words}</text>')
    parts.append(_limits(limits, x, y, text))
    own = [point for curve in curves if curve.kind == "own" for point in curve.points]
    parts += [_limit_name(each, own, x, y, text, f"{texts.limit} {_short(each.area_mm2, number)}") for each in limits]
    parts.append(_legend(texts.legend, left, high, text))
    whole = high + round(1.5 * text * len(texts.legend))
    parts.append(_press_legend(texts.presses, left, (right - left) / _PRESS_COLUMNS, whole, text))
    whole += round(1.5 * text * ceil(len(texts.presses) / _PRESS_COLUMNS))
    return Markup(  # noqa: S704 (numbers, our own classes, and escaped texts)
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart area-chart" viewBox="0 0 {wide} {whole}" role="img" '
        f'font-size="{text}" aria-label="{escape(texts.label)}">{"".join(parts)}</svg>'
    )


def document(chart: Markup) -> str:
    """Make an SVG document of a chart, with its style inside."""
    head, end, rest = chart.partition(">")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}{end}<style>\n{style()}</style>{rest}\n'


def _axes(x: Axis, y: Axis, texts: Texts, size: Size, number: Callable[[float, int], str]) -> str:
    _, high, text = size
    left, right, bottom = x(x.ticks[0].value), x(x.ticks[-1].value), y(0.0)
    parts = []
    for tick in y.ticks:
        at = y(tick.value)
        parts.append(f'<path class="chart-grid" d="M{left} {at}H{right}"/>')
        words = escape(number(tick.value, tick.digits))
        parts.append(f'<text x="{left - text / 2:.1f}" y="{at + 0.3 * text:.1f}" text-anchor="end">{words}</text>')
    for tick in x.ticks:
        at = x(tick.value)
        parts.append(f'<path class="chart-tick" d="M{at} {bottom}v{text / 3:.1f}"/>')
        words = escape(number(tick.value, tick.digits))
        parts.append(f'<text x="{at}" y="{bottom + 1.4 * text:.1f}" text-anchor="middle">{words}</text>')
    parts.append(f'<path class="chart-axis" d="M{left} {bottom}H{right}"/>')
    parts.append(
        f'<text x="{right}" y="{high - 0.35 * text:.1f}" text-anchor="end">{escape(texts.closing)}</text>'
        f'<text class="chart-name" x="{left}" y="{1.05 * text:.1f}">{escape(texts.area)}</text>'
    )
    return "".join(parts)


def _curve(curve: Curve, x: Axis, y: Axis, text: int) -> str:
    places = [(x(closing_mm), y(area_mm2)) for closing_mm, area_mm2 in curve.points]
    line = " ".join(f"{at_x:g},{at_y:g}" for at_x, at_y in places)
    signs = (_sign(mark, *place, text / 4) for place, mark in zip(places, curve.marks, strict=False))
    drawn = f'<polyline class="curve curve-{curve.kind}" points="{line}"/>{"".join(signs)}'
    return f'<g class="{_press_class(curve.press)}">{drawn}</g>' if curve.press else drawn


def _sign(mark: str, x: float, y: float, r: float) -> str:
    across = round(2 * r, 1)
    match mark:
        case "bound":
            return f'<path class="mark-bound" d="M{x - r:.1f} {y + r:.1f}h{across}l{-r:.1f} {-across}z"/>'
        case "decided":
            return (
                f'<circle class="mark-point" cx="{x}" cy="{y}" r="{r:.1f}"/>'
                f'<circle class="mark-decided" cx="{x}" cy="{y}" r="{2.2 * r:.1f}"/>'
            )
        case "wrong":
            cross = f"M{x - r:.1f} {y - r:.1f}l{across} {across}m0 {-across}l{-across} {across}"
            return f'<path class="mark-wrong" d="{cross}"/>'
        case _:
            return f'<circle class="mark-{mark}" cx="{x}" cy="{y}" r="{r:.1f}"/>'


def _limits(limits: Sequence[Limit], x: Axis, y: Axis, text: int) -> str:
    """Draw each limit as a line across its closing with a triangle upon it, and their link; a former one is thin."""
    parts, arm, sign = [], 0.95 * text, 0.4 * text
    for former in (True, False):
        placed = [(x(each.closing_mm), y(each.area_mm2), each) for each in limits if each.former is former]
        kind = " former" if former else ""
        if placed:
            link = " ".join(f"{at_x:g},{at_y:g}" for at_x, at_y, _ in placed)
            parts.append(f'<polyline class="limit-link{kind}" points="{link}"/>')
        for at_x, at_y, limit in placed:
            parts.append(f'<path class="limit{kind}" d="M{at_x - arm:.1f} {at_y}h{2 * arm:.1f}"/>')
            if not former:
                parts.append(
                    f'<path class="limit-sign" d="M{at_x - sign:.1f} {at_y}l{sign:.1f} {-1.3 * sign:.1f} '
                    f'{sign:.1f} {1.3 * sign:.1f}z"/>'
                )
            if limit.least_area_mm2 > 0:
                least = y(limit.least_area_mm2)
                parts.append(f'<path class="limit least{kind}" d="M{at_x - 0.7 * arm:.1f} {least}h{1.4 * arm:.1f}"/>')
    return "".join(parts)


def _limit_name(limit: Limit, own: Sequence[tuple[float, float]], x: Axis, y: Axis, text: int, words: str) -> str:
    """Write a limit's area beside its sign; nothing for a former one, whose place the present one's name needs."""
    if limit.former:
        return ""
    at_x = min(x(limit.closing_mm), x(x.ticks[-1].value) - 0.3 * text * len(words))
    nearest = min(own, key=lambda point: abs(point[0] - limit.closing_mm), default=(0.0, 0.0))
    # Above the sign, unless the curve passes there.
    at_y = y(limit.area_mm2) + (1.1 if nearest[1] > limit.area_mm2 else -0.75) * text
    place = f'x="{at_x:.1f}" y="{at_y:.1f}" text-anchor="middle"'
    return f'<text class="limit-name" {place}>{escape(words)}</text>'


def _short(area_mm2: float, number: Callable[[float, int], str]) -> str:
    """Format a limit's area with the one digit that it may have: 96.5 is neither 96 nor 97, and 98 is no 98.0."""
    whole = abs(area_mm2 - round(area_mm2)) < _LEAST_SHOWN_MM2
    return number(area_mm2, 0 if whole else 1)


def _legend(legend: Sequence[tuple[Kind | Mark, str]], left: float, high: float, text: int) -> str:
    parts = []
    for row, (kind, words) in enumerate(legend):
        at = high + (1.5 * row + 0.7) * text
        if kind in {"point", "decided", "doubtful", "bound", "wrong"}:
            parts.append(_sign(kind, left + 1.2 * text, at, text / 4))
        else:
            parts.append(f'<path class="curve curve-{kind}" d="M{left} {at:.1f}h{2.4 * text:.1f}"/>')
        parts.append(f'<text x="{left + 3 * text}" y="{at + 0.35 * text:.1f}">{escape(words)}</text>')
    return "".join(parts)


def _press_class(press: int) -> str:
    return f"press-{(press - 1) % _PRESS_COLOURS + 1}"


def _press_numbers(curves: Sequence[Curve], x: Axis, y: Axis, text: int) -> str:
    """Write each press's number beside the end of its line, one below the other where ends are close."""
    ends = sorted((y(each.points[-1][1]), x(each.points[-1][0]), each.press) for each in curves if each.press)
    parts: list[str] = []
    placed: list[tuple[float, float]] = []
    for end_y, at_x, press in ends:
        at_y = max([end_y, *(other_y + text for other_x, other_y in placed if abs(other_x - at_x) < 2 * text)])
        placed.append((at_x, at_y))
        parts.append(
            f'<text class="chart-name {_press_class(press)}" x="{at_x + 0.5 * text:.1f}" '
            f'y="{at_y + 0.35 * text:.1f}">{press}</text>'
        )
    return "".join(parts)


def _press_legend(presses: Sequence[str], left: float, column: float, high: float, text: int) -> str:
    """Write each press's text beside a piece of its line, column by column."""
    parts, rows = [], ceil(len(presses) / _PRESS_COLUMNS)
    for place, words in enumerate(presses):
        x, at = left + place // rows * column, high + (1.5 * (place % rows) + 0.7) * text
        parts.append(
            f'<g class="{_press_class(place + 1)}"><path class="curve curve-own" d="M{x:.1f} {at:.1f}h{2 * text}"/></g>'
            f'<text x="{x + 2.5 * text:.1f}" y="{at + 0.35 * text:.1f}">{escape(words)}</text>'
        )
    return "".join(parts)
