"""Histogram of deciding contact areas by outcome as SVG, with the recipe's limits, for a report."""

from collections.abc import Sequence

from markupsafe import Markup

from station.charts.axis import Axis

WIDE, HIGH, TEXT = 460, 250, 13
_LEFT, _RIGHT, _TOP, _BOTTOM = 40, 448, 34, 206
_COLOURS = ("var(--good)", "var(--bad)", "var(--unjudged)")

Bin = tuple[float, int, int, int]
"""Upper bound in mm²; PASS, FAIL and NO_RESULT below it and above the bin before."""


def area_histogram(bins: Sequence[Bin], limits: Sequence[tuple[float, float]]) -> Markup:
    """Draw a histogram of bins of equal width from 0, with limits (closing in mm, area in mm²); empty for no bins."""
    if not bins:
        return Markup()
    width_mm2 = bins[0][0]
    x = Axis(0.0, max(bins[-1][0], *(area for _, area in limits), 0.0), _LEFT, _RIGHT, 6)
    y = Axis(0.0, max(*(sum(counts) for _, *counts in bins), 1), _BOTTOM, _TOP, 4)
    parts = [_axes(x, y)]
    for bound, *counts in bins:
        low = 0
        for count, colour in zip(counts, _COLOURS, strict=True):
            top, wide = y(low + count), x(bound) - x(bound - width_mm2) - 1
            parts.append(
                f'<rect x="{x(bound - width_mm2)}" y="{top}" width="{wide:.1f}" height="{y(low) - top:.1f}" '
                f'fill="{colour}"/>'
            )
            low += count
    for row, (closing_mm, area_mm2) in enumerate(limits):
        at, end = x(area_mm2), ' text-anchor="end"' if x(area_mm2) > WIDE / 2 else ""
        parts.append(f'<path class="limit" d="M{at} {_TOP - 6}V{_BOTTOM}"/>')
        beside = at - 4 if end else at + 4
        text = f"limit {area_mm2:.0f} at {closing_mm:g} mm"
        parts.append(f'<text class="limit-name" x="{beside:.1f}" y="{TEXT + 15 * row}"{end}>{text}</text>')
    return Markup(  # noqa: S704 (numbers and our own words)
        f'<svg class="chart bars" viewBox="0 0 {WIDE} {HIGH}" role="img" font-size="{TEXT}" '
        f'aria-label="Histogram of the deciding contact area by outcome, with the limits">{"".join(parts)}</svg>'
    )


def _axes(x: Axis, y: Axis) -> str:
    parts = [f'<path class="chart-axis" d="M{_LEFT} {_BOTTOM}H{_RIGHT}"/>']
    for tick in y.ticks:
        if tick.value.is_integer():
            at = y(tick.value)
            parts.append(f'<path class="chart-grid" d="M{_LEFT} {at}H{_RIGHT}"/>')
            parts.append(f'<text x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{tick.value:.0f}</text>')
    for tick in x.ticks:
        at = x(tick.value)
        parts.append(f'<path class="chart-tick" d="M{at} {_BOTTOM}v5"/>')
        parts.append(f'<text x="{at}" y="{_BOTTOM + 19}" text-anchor="middle">{tick.value:.{tick.digits}f}</text>')
    parts.append(f'<text x="{_RIGHT}" y="{HIGH - 6}" text-anchor="end">contact area, mm²</text>')
    parts.append(f'<text x="0" y="{HIGH - 6}">fruit</text>')
    return "".join(parts)
