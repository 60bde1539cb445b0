"""Chart of an analysis's area curve."""

from collections.abc import Sequence

from markupsafe import Markup

from station.charts.area_chart import Curve, Kind, Mark, Size, Texts, area_chart
from station.inspection.curve import AreaCurve
from station.inspection.monotone import WrongFrame

_WORDS: dict[Kind | Mark, str] = {
    "own": "contact area",
    "changed": "changed area",
    "bound": "lower bound: the contact is at least this large",
    "wrong": "does not fit: a contact cannot shrink while closing",
}


def curve_chart(
    curve: AreaCurve,
    wrong: Sequence[WrongFrame],
    title: str,
    *,
    changed_mm2: Sequence[float | None],
    lower_bounds: Sequence[int],
) -> Markup:
    """Draw area over closing in the manner of the paper's Fig. 14, with the changed area of each image.

    Args:
        curve: a curve with at least one point.
        wrong: the points that do not fit the others; they are marked, not moved.
        title: the pressed object and the method.
        changed_mm2: changed area of each point's image; None if the method does not measure it.
        lower_bounds: indices of the points whose contact is at least as large as their area.
    """
    points = [(point.closing_mm, point.reading.area_mm2) for point in curve.points]
    marks: list[Mark] = ["point"] * len(points)
    for place in lower_bounds:
        marks[place] = "bound"
    for frame in wrong:
        marks[frame.index] = "wrong"
    witness = [(x, changed) for (x, _), changed in zip(points, changed_mm2, strict=True) if changed is not None]
    curves = [Curve("own", points, marks)]
    if witness:
        curves.insert(0, Curve("changed", witness))
    shown = {each.kind for each in curves} | set(marks)
    texts = Texts(
        f"Area over closing: {title}",
        area="area, mm²",
        onset=f"onset at {curve.onset_mm:g} mm",
        legend=[(kind, words) for kind, words in _WORDS.items() if kind in shown] if len(shown) > 2 else (),
    )
    return area_chart(curves, (), texts, size=Size(720, 400, 14))
