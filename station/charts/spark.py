"""Sparkline: a curve's shape without axes, for a tile or a row of a list."""

from collections.abc import Sequence

from markupsafe import Markup


def spark(areas_mm2: Sequence[float | None], wide: int = 96, high: int = 28) -> Markup:
    """Draw a curve as SVG, from 0 to its largest area, steps without one left out; decoration beside its number."""
    largest = max((area for area in areas_mm2 if area is not None), default=0.0) or 1.0
    gap = (wide - 4) / max(1, len(areas_mm2) - 1)
    points = " ".join(
        f"{2 + number * gap:.1f},{high - 2 - (high - 4) * max(0.0, area) / largest:.1f}"
        for number, area in enumerate(areas_mm2)
        if area is not None
    )
    return Markup(
        '<svg class="spark" viewBox="0 0 {0} {1}" width="{0}" height="{1}" aria-hidden="true">'
        '<polyline points="{2}"/></svg>'
    ).format(wide, high, points)
