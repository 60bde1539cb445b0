"""Charts of the run page, without colour: the last fruit's curve, diverted fruit over time, the cycle time's share."""

from collections.abc import Sequence

from markupsafe import Markup, escape

from hmi.common.charts import area_over_closing, mark_decided
from hmi.web.translation import Locale
from station.channel.panel_run import Fruit, FruitSummary
from station.charts.area_chart import Curve, Limit, Mark, Size

TREND_BUCKET = 10
_TREND_HIGH = 52
_CURVE = Size(540, 176, 16)


def curve(fruit: Fruit, locale: Locale) -> Markup:
    """Draw a fruit's contact area over closing, with the recipe's limits."""
    points = [(point.closing_mm, point.area_mm2) for point in fruit.curve]
    marks: list[Mark] = ["doubtful" if point.flagged else "point" for point in fruit.curve]
    mark_decided(marks, points, fruit.short.closing_mm)
    limits = [Limit(each.closing_mm, each.area_mm2, each.least_area_mm2) for each in fruit.limits]
    label = locale.text("run.curve_label", area=locale.number(fruit.short.area_mm2, 1), points=len(points))
    return area_over_closing([Curve("own", points, marks)], limits, locale, label, size=_CURVE)


def trend(fruit: Sequence[FruitSummary], locale: Locale) -> Markup:
    """Draw the diverted among ten fruit, ten after ten, the newest at the right: failed below, not judged above."""
    buckets = [fruit[at : at + TREND_BUCKET] for at in range(0, len(fruit) - TREND_BUCKET + 1, TREND_BUCKET)][::-1]
    width, height, left, low = 340, 86, 54, 62
    parts = []
    for share in (0.0, 1.0):
        at = low - share * _TREND_HIGH
        parts.append(f'<path class="chart-grid" d="M{left} {at:.0f}H{width}"/>')
        parts.append(f'<text x="{left - 6}" y="{at + 4:.0f}" text-anchor="end">{escape(locale.percent(share))}</text>')
    step = (width - left) / max(8, len(buckets))
    for number, bucket in enumerate(buckets):
        failed = sum(each.outcome == "FAIL" for each in bucket) / len(bucket)
        unjudged = sum(each.outcome == "NO_RESULT" for each in bucket) / len(bucket)
        at, wide = width - (len(buckets) - number) * step + 2, step - 4
        parts.append(_bar("bar-fail", at, low - failed * _TREND_HIGH, wide, failed * _TREND_HIGH))
        top = low - (failed + unjudged) * _TREND_HIGH
        parts.append(_bar("bar-unjudged", at, top, wide, unjudged * _TREND_HIGH))
    note = locale.text("run.trend_axis", n=TREND_BUCKET)
    parts.append(f'<text x="{width}" y="{height - 6}" text-anchor="end">{escape(note)}</text>')
    diverted = [sum(each.outcome != "PASS" for each in bucket) for bucket in buckets]
    label = locale.text("run.trend_label", figures=", ".join(map(str, diverted)) or "–")  # noqa: RUF001 (a dash)
    return Markup(  # noqa: S704 (numbers, our own classes, and escaped texts)
        f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" font-size="13" aria-label="{escape(label)}">'
        f"{''.join(parts)}</svg>"
    )


def bar(value: float, largest: float) -> Markup:
    """Draw the used share of a limit; decoration beside its number."""
    filled = 300 * min(1.0, max(0.0, value / largest)) if largest > 0 else 0.0
    drawn = Markup(
        '<svg class="chart bar" viewBox="0 0 300 16" aria-hidden="true">'
        '<rect class="bar-room" width="300" height="16"/><rect class="bar-fail" width="{:.1f}" height="16"/></svg>'
    )
    return drawn.format(filled)


def _bar(name: str, x: float, y: float, width: float, height: float) -> str:
    if height <= 0:
        return ""
    return f'<rect class="{name}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
