"""Charts of the pages: area over closing, in the reader's language."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from markupsafe import Markup

from hmi.web.translation import Locale
from station.channel.panel_run import LimitView
from station.charts.area_chart import Curve, Limit, Mark, Size, Texts, area_chart

LimitT = TypeVar("LimitT", Limit, LimitView)
_SAME_MM = 0.01
"""Closings are rounded on their way to the pages."""


def area_over_closing(
    curves: Sequence[Curve],
    limits: Sequence[Limit],
    locale: Locale,
    label: str,
    early_stop_mm2: float | None = None,
    size: Size = Size(),  # noqa: B008 (immutable)
) -> Markup:
    """Draw areas over closing with a recipe's limits.

    Args:
        curves: drawn in this order.
        limits: in ascending order of closing.
        label: what the chart shows, for who cannot see it.
        early_stop_mm2: the early stop's area; None for none.
    """
    closing, area, early, limit = (locale.text(f"chart.{name}") for name in ("closing", "area", "early", "limit"))
    texts = Texts(label, closing, area, early, limit)
    return area_chart(curves, limits, texts, early_stop_mm2=early_stop_mm2, size=size, number=locale.number)


def mark_decided(marks: list[Mark], points: Sequence[tuple[float, float]], closing_mm: float | None) -> None:
    """Mark the point that decided, which has the outcome's closing, unless its own mark says more."""
    if closing_mm is None or not points:
        return
    nearest = min(range(len(points)), key=lambda place: abs(points[place][0] - closing_mm))
    if marks[nearest] == "point" and abs(points[nearest][0] - closing_mm) < _SAME_MM:
        marks[nearest] = "decided"


def deciding_limit(limits: Iterable[LimitT], decided_mm: float | None) -> LimitT | None:
    """Return the limit nearest to where the fruit was decided; None if there was no area."""
    if decided_mm is None:
        return None
    return min(limits, key=lambda limit: abs(limit.closing_mm - decided_mm), default=None)
