"""Charts of the pages: area over closing, in the reader's language."""

from collections.abc import Sequence

from markupsafe import Markup

from hmi.web.translation import Locale
from station.charts.area_chart import Curve, Limit, Size, Texts, area_chart


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
        locale: the language.
        label: what the chart shows, for who cannot see it.
        early_stop_mm2: the early stop's area; None for none.
        size: of the drawing.
    """
    texts = Texts(label, locale.text("chart.closing"), locale.text("chart.area"), locale.text("chart.early"))
    return area_chart(curves, limits, texts, early_stop_mm2=early_stop_mm2, size=size, number=locale.number)
