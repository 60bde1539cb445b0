"""The histogram of deciding areas: every fruit, both axes, and the limits."""

import re
import xml.etree.ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st

from station.charts.area_histogram import area_histogram

COUNTS = st.lists(st.tuples(*[st.integers(0, 50)] * 3), min_size=1, max_size=24)


@given(COUNTS, st.lists(st.tuples(st.floats(0.5, 5), st.floats(1, 300)), max_size=3))
def test_every_fruit_is_drawn_within_the_axes_whatever_its_outcome(counts, limits):
    chart = ET.fromstring(area_histogram([(5.0 * (n + 1), *each) for n, each in enumerate(counts)], limits))
    bars = [each for each in chart.iter() if each.tag.endswith("rect")]
    colours: list[str] = ["var(--good)", "var(--bad)", "var(--unjudged)"]
    heights = dict.fromkeys(colours, 0.0)
    for each in bars:
        heights[each.attrib["fill"]] += float(each.attrib["height"])
        assert 30 <= float(each.attrib["y"]) <= 207
        assert 39 <= float(each.attrib["x"]) <= 449
    for place, colour in enumerate(heights):
        assert (heights[colour] > 0) == any(each[place] for each in counts)
    lines = [each for each in chart.iter() if each.get("class") == "limit"]
    assert len(lines) == len(limits)


def test_a_limit_is_named_and_stands_between_the_areas_around_it():
    bins = [(50.0, 1, 0, 0), (100.0, 2, 0, 1), (150.0, 0, 3, 0)]
    chart = area_histogram(bins, [(3.0, 98.0)])
    assert "limit 98 at 3 mm" in chart
    at = float(re.findall(r'class="limit" d="M([\d.]+)', chart)[0])
    left, right = (float(text) for text in re.findall(r'<rect x="([\d.]+)"', chart)[3::3])
    assert left < at <= right + 1
    assert area_histogram([], []) == ""
