"""SVG charts, without colour: an area curve with its limits, a trend of rejects, a curve on a tile."""

from collections.abc import Callable, Sequence

from markupsafe import Markup, escape

from hmi.web.translation import Locale
from station.channel.panel_live import Fruit, FruitSummary

WIDTH, HEIGHT = 360, 290
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 12, 16, 44
TREND_BUCKET = 10
_STEPS = (1, 2, 5)
Scale = Callable[[float], float]


def ticks(largest: float, most: int = 5) -> list[float]:
    """Return round numbers from 0 on for an axis.

    Args:
        largest: the number to reach.
        most: the approximate count.
    """
    if largest <= 0:
        return [0.0, 1.0]
    power = 1.0
    while largest / power > most:
        power *= 10
    while largest / power <= most / 10:
        power /= 10
    step = next((power * each / 10 for each in (*_STEPS, 10) if largest / (power * each / 10) <= most), power)
    count = int(largest / step - 1e-9) + 1
    return [step * each for each in range(count + 1)]


def curve(fruit: Fruit, locale: Locale) -> Markup:
    """Draw a fruit's contact area over closing, with the recipe's limits."""
    closings = [point.closing_mm for point in fruit.curve] + [each.closing_mm for each in fruit.limits]
    areas = [point.area_mm2 for point in fruit.curve] + [each.area_mm2 for each in fruit.limits]
    across, up = ticks(max([*closings, 1.0])), ticks(1.05 * max([*areas, 1.0]))

    def x(closing_mm: float) -> float:
        return _LEFT + closing_mm / across[-1] * (WIDTH - _LEFT - _RIGHT)

    def y(area_mm2: float) -> float:
        return HEIGHT - _BOTTOM - area_mm2 / up[-1] * (HEIGHT - _TOP - _BOTTOM)

    parts = [_axes(across, up, x, y, locale)]
    for limit in fruit.limits:
        at = x(limit.closing_mm)
        parts.append(f'<path class="limit" d="M{at:.1f} {y(limit.area_mm2):.1f}V{_TOP}"/>')
        parts.append(f'<path class="limit-mark" d="M{at - 14:.1f} {y(limit.area_mm2):.1f}h28"/>')
        if limit.least_area_mm2 > 0:
            parts.append(f'<path class="limit-mark least" d="M{at - 14:.1f} {y(limit.least_area_mm2):.1f}h28"/>')
    points = " ".join(f"{x(point.closing_mm):.1f},{y(point.area_mm2):.1f}" for point in fruit.curve)
    parts.append(f'<polyline class="line" points="{points}"/>')
    for point in fruit.curve:
        shape = "doubtful" if point.flagged else "point"
        parts.append(f'<circle class="{shape}" cx="{x(point.closing_mm):.1f}" cy="{y(point.area_mm2):.1f}" r="4"/>')
    label = escape(locale.text("run.curve_label", area=locale.number(fruit.short.area_mm2, 1), points=len(fruit.curve)))
    below, beside = escape(locale.text("run.closing")), escape(locale.text("run.area"))
    texts = (
        f'<text x="{WIDTH - _RIGHT}" y="{HEIGHT - 4}" text-anchor="end">{below} (mm)</text>'
        f'<text x="{_LEFT + 6}" y="{_TOP + 2}">{beside} (mm²)</text>'
    )
    return _svg(WIDTH, HEIGHT, label, "".join(parts) + texts)


def trend(fruit: Sequence[FruitSummary], locale: Locale) -> Markup:
    """Draw the rejects among ten fruit, ten after ten, the newest at the right: failed below, not judged above."""
    buckets = [fruit[at : at + TREND_BUCKET] for at in range(0, len(fruit) - TREND_BUCKET + 1, TREND_BUCKET)][::-1]
    width, height, left, low = 300, 118, 46, 92
    parts = []
    for share in (0.0, 0.5, 1.0):
        at = low - share * 80
        parts.append(f'<path class="grid-line" d="M{left} {at:.0f}H{width}"/>')
        parts.append(f'<text x="{left - 6}" y="{at + 4:.0f}" text-anchor="end">{escape(locale.percent(share))}</text>')
    step = (width - left) / max(8, len(buckets))
    for number, bucket in enumerate(buckets):
        failed = sum(each.outcome == "FAIL" for each in bucket) / len(bucket)
        unjudged = sum(each.outcome == "NO_RESULT" for each in bucket) / len(bucket)
        at, wide = width - (len(buckets) - number) * step + 2, step - 4
        parts.append(_bar("bar-fail", at, low - failed * 80, wide, failed * 80))
        parts.append(_bar("bar-unjudged", at, low - (failed + unjudged) * 80, wide, unjudged * 80))
    note = locale.text("run.trend_axis", n=TREND_BUCKET)
    parts.append(f'<text x="{width}" y="{height - 6}" text-anchor="end">{escape(note)}</text>')
    rejected = [sum(each.outcome != "PASS" for each in bucket) for bucket in buckets]
    label = locale.text("run.trend_label", figures=", ".join(map(str, rejected)) or "–")  # noqa: RUF001 (a dash)
    return _svg(width, height, escape(label), "".join(parts))


def sketch(areas_mm2: Sequence[float]) -> Markup:
    """Draw a curve's shape on a tile."""
    most, last = max([*areas_mm2, 1.0]), max(1, len(areas_mm2) - 1)
    points = " ".join(f"{2 + 56 * n / last:.1f},{22 - 20 * area / most:.1f}" for n, area in enumerate(areas_mm2))
    return Markup('<svg class="sketch" viewBox="0 0 60 24" aria-hidden="true"><polyline points="{}"/></svg>').format(
        points
    )


def bar(value: float, largest: float) -> Markup:
    """Draw the used share of a limit; decoration beside its number."""
    filled = 300 * min(1.0, max(0.0, value / largest)) if largest > 0 else 0.0
    drawn = Markup(
        '<svg class="chart bar" viewBox="0 0 300 16" aria-hidden="true">'
        '<rect class="bar-room" width="300" height="16"/><rect class="bar-fail" width="{:.1f}" height="16"/></svg>'
    )
    return drawn.format(filled)


def _axes(across: list[float], up: list[float], x: Scale, y: Scale, locale: Locale) -> str:
    parts = []
    for value in up:
        digits = 0 if up[1] >= 1 else 1
        parts.append(f'<path class="grid-line" d="M{_LEFT} {y(value):.1f}H{WIDTH - _RIGHT}"/>')
        parts.append(
            f'<text x="{_LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{locale.number(value, digits)}</text>'
        )
    for value in across:
        digits = 0 if across[1] >= 1 else 1
        parts.append(f'<path class="tick" d="M{x(value):.1f} {HEIGHT - _BOTTOM}v5"/>')
        parts.append(
            f'<text x="{x(value):.1f}" y="{HEIGHT - _BOTTOM + 20}" text-anchor="middle">'
            f"{locale.number(value, digits)}</text>"
        )
    return "".join(parts)


def _bar(name: str, x: float, y: float, width: float, height: float) -> str:
    if height <= 0:
        return ""
    return f'<rect class="{name}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'


def _svg(width: int, height: int, label: object, inside: str) -> Markup:
    """Make a chart; its content is already escaped."""
    return Markup(  # noqa: S704 (numbers, our own classes, and escaped texts)
        f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="{label}">{inside}</svg>'
    )
