"""Chart of an analysis's area curves."""

from collections.abc import Sequence

from markupsafe import Markup

from station.analysis.press_curve import PressCurve
from station.charts.area_chart import Curve, Kind, Mark, Size, Texts, area_chart

_WORDS: dict[Kind | Mark, str] = {
    "own": "contact area",
    "changed": "changed area",
    "bound": "lower bound: the contact is at least this large",
    "wrong": "does not fit: a contact cannot shrink while closing",
}


def curve_chart(presses: Sequence[PressCurve], title: str) -> Markup:
    """Draw area over closing in the manner of the paper's Fig. 14, one line a press.

    A press alone is drawn with the changed area of its images; of several it would hide the others' lines.

    Args:
        presses: at least one of them with points; those that do not fit the others are marked, not moved.
        title: the pressed object and the method.
    """
    several = len(presses) > 1
    curves = [_curve(press, several=several) for press in presses if press.curve.points]
    if not several and (changed := _changed(presses[0])):
        curves.insert(0, changed)
    shown = {each.kind for each in curves} | {mark for each in curves for mark in each.marks}
    if several:
        shown.discard("own")  # each press has its own line in the legend
    texts = Texts(
        f"Area over closing: {title}",
        area="contact area, mm²" if several else "area, mm²",
        onset="onset" if several else f"onset at {presses[0].curve.onset_mm:g} mm",
        legend=[(kind, words) for kind, words in _WORDS.items() if kind in shown] if several or len(shown) > 2 else (),
        presses=[_press_words(press) for press in presses] if several else (),
    )
    return area_chart(curves, (), texts, size=Size(720, 400, 14))


def _curve(press: PressCurve, *, several: bool) -> Curve:
    marks: list[Mark] = ["bound" if row.lower_bound else "point" for row in press.rows]
    for frame in press.wrong:
        marks[frame.index] = "wrong"
    points = [(point.closing_mm, point.reading.area_mm2) for point in press.curve.points]
    return Curve("own", points, marks, press.number if several else 0)


def _changed(press: PressCurve) -> Curve | None:
    points = [
        (point.closing_mm, row.changed_area_mm2)
        for row, point in zip(press.rows, press.curve.points, strict=True)
        if row.changed_area_mm2 is not None
    ]
    return Curve("changed", points) if points else None


def _press_words(press: PressCurve) -> str:
    onset_mm = press.curve.onset_mm
    return f"press {press.number}: " + ("no onset" if onset_mm is None else f"onset at {onset_mm:g} mm")
