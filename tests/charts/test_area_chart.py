"""The chart of area over closing: everything within it, in its place, and text as text."""

import xml.etree.ElementTree as ET
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.charts.area_chart import Curve, Kind, Limit, Mark, Size, Texts, area_chart, document
from station.charts.spark import spark

SVG = "{http://www.w3.org/2000/svg}"
AREAS = st.floats(0, 260)


def shapes(chart, kind):
    return [each for each in ET.fromstring(chart).iter() if each.get("class") == kind]


def start(path):
    """Return the point where a path begins."""
    x, y = path.get("d")[1:].split("h")[0].split("l")[0].split("V")[0].split(" ")
    return float(x), float(y)


@given(st.lists(st.tuples(st.floats(-5, 50), AREAS), max_size=30), st.floats(0.5, 50), st.floats(1, 260), AREAS)
def test_nothing_is_drawn_outside_and_each_point_is_on_its_side_of_the_limit(points, closing_mm, limit_mm2, early_mm2):
    chart = area_chart(
        [Curve("own", points, ("point",) * len(points))], [Limit(closing_mm, limit_mm2)], Texts("x"),
        early_stop_mm2=early_mm2,
    )  # fmt: skip
    places = [(float(each.attrib["cx"]), float(each.attrib["cy"])) for each in shapes(chart, "mark-point")]
    assert all(61 <= x <= 703 and 31 <= y <= 284 for x, y in places)
    ((link,),) = [each.attrib["points"].split(" ") for each in shapes(chart, "limit-link")]
    at_x, at_y = map(float, link.split(","))
    for (x, y), (value, area) in zip(places, points, strict=True):
        assert (x - at_x) * (value - closing_mm) >= 0
        assert (at_y - y) * (area - limit_mm2) >= 0
    assert len(shapes(chart, "early")) == 1


def test_every_sign_has_its_shape_and_the_legend_its_words():
    marks: tuple[Mark, ...] = ("point", "doubtful", "bound", "wrong")
    points = [(float(n), 10.0 * n) for n in range(4)]
    legend: list[tuple[Kind | Mark, str]] = [*((mark, f"the sign {mark}") for mark in marks), ("own", "the line")]
    chart = area_chart([Curve("own", points, marks)], (), Texts("x", legend=legend))
    assert all(len(shapes(chart, f"mark-{mark}")) == 2 for mark in marks)
    assert len(shapes(chart, "curve curve-own")) == 2
    words = [each.text for each in ET.fromstring(chart).iter(f"{SVG}text")]
    assert words[-5:] == [text for _, text in legend]


def test_presses_have_a_line_a_colour_and_a_number_each_and_numbers_do_not_hide_each_other():
    ends = (40.0, 40.5, 41.0, 80.0, 40.2, 81.0, 79.0, 20.0)
    curves = [
        Curve("own", [(0.0, 1.0), (4.0, end)], ("point", "point"), number) for number, end in enumerate(ends, start=1)
    ]
    words = [f"press {number}: <onset>" for number in range(1, 9)]
    chart = area_chart(curves, (), Texts("x", presses=words), size=Size(720, 400, 14))
    drawn = [each for each in ET.fromstring(chart).iter(f"{SVG}g") if each.find(f"{SVG}polyline") is not None]
    assert [each.get("class") for each in drawn] == [f"press-{number}" for number in (1, 2, 3, 4, 5, 6, 7, 1)]
    assert all(len(each.findall(f"{SVG}circle")) == 2 for each in drawn)
    numbers = {
        each.text: float(each.attrib["y"])
        for each in ET.fromstring(chart).iter(f"{SVG}text")
        if each.get("class", "").startswith("chart-name press-")
    }
    assert list(numbers) == ["6", "4", "7", "3", "2", "5", "1", "8"], "as the lines end, from above"
    places = list(numbers.values())
    assert all(lower - upper >= 14 - 0.11 for upper, lower in pairwise(places)), "rounded to a tenth"
    legend = [each for each in ET.fromstring(chart).iter(f"{SVG}text") if (each.text or "").startswith("press ")]
    assert [each.text for each in legend] == words
    height = float(ET.fromstring(chart).attrib["viewBox"].split(" ")[3])
    assert all(400 < float(each.attrib["y"]) < height for each in legend)
    assert len({(each.attrib["x"], each.attrib["y"]) for each in legend}) == 8


def test_limits_of_two_recipes_differ_and_the_least_area_is_drawn():
    limits = [Limit(2.0, 30.0, former=True), Limit(2.0, 40.0, 5.0), Limit(3.0, 60.0)]
    chart = area_chart([], limits, Texts("x"), size=Size(300, 170, 12))
    assert [len(shapes(chart, kind)) for kind in ("limit", "limit former", "limit least", "limit-sign")] == [2, 1, 1, 2]
    higher, lower = (start(each)[1] for each in (shapes(chart, "limit")[1], shapes(chart, "limit")[0]))
    assert higher < lower < start(shapes(chart, "limit least")[0])[1]


@pytest.mark.parametrize(("area_mm2", "above"), [(30.0, True), (70.0, False)])
def test_a_limit_is_named_with_its_area_where_the_curve_does_not_pass(area_mm2, above):
    limits = [Limit(3.0, 50.4), Limit(3.0, 80.0, former=True)]
    chart = area_chart([Curve("own", [(0.0, 0.0), (3.0, area_mm2)], ("point", "decided"))], limits, Texts("x"))
    (name,) = shapes(chart, "limit-name")
    assert name.text == "limit 50.4"
    assert (float(name.attrib["y"]) < start(shapes(chart, "limit")[0])[1]) == above
    (ring,) = shapes(chart, "mark-decided")
    point = shapes(chart, "mark-point")[-1]
    assert (ring.attrib["cx"], ring.attrib["cy"]) == (point.attrib["cx"], point.attrib["cy"])


def test_onset_is_beside_negative_closings():
    chart = area_chart([Curve("own", [(-1.0, 0.0), (4.0, 50.0)])], (), Texts("x", onset="onset at 30 mm"))
    x = start(shapes(chart, "onset")[0])[0]
    assert 61 < x < 300
    assert "onset at 30 mm" in chart


def test_numbers_are_in_the_readers_language_and_words_are_text():
    texts = Texts("<label>", "<closing>", "<area>", "<early>")
    chart = area_chart([], (), texts, early_stop_mm2=3.0, number=lambda value, digits: f"<{value:.{digits}f}>")
    assert ET.fromstring(chart).attrib["aria-label"] == "<label>"
    words = [each.text for each in ET.fromstring(chart).iter(f"{SVG}text")]
    assert {"<closing>", "<area>", "<early>", "<0.0>"} <= set(words)


def test_a_document_contains_its_style_and_is_the_same_for_the_same_input():
    made = [document(area_chart([Curve("own", [(1.0, 2.0)])], (), Texts("x"))) for _ in range(2)]
    assert made[0] == made[1]
    assert ".curve-own" in "".join(ET.fromstring(made[0].encode()).itertext())


@pytest.mark.parametrize("areas", [(), (None,), (0.0,), (1.0, None, 5.0)])
def test_a_sparkline_leaves_out_what_was_not_measured(areas):
    line = next(iter(ET.fromstring(spark(areas))))
    assert len(line.attrib["points"].split()) == sum(area is not None for area in areas)


@pytest.mark.parametrize(("area_mm2", "words"), [(96.5, "limit 96.5"), (98.0, "limit 98"), (85.26, "limit 85.3")])
def test_a_limit_is_named_as_exactly_as_it_was_chosen(area_mm2, words):
    assert f">{words}<" in area_chart([], [Limit(3.0, area_mm2)], Texts("x"))
