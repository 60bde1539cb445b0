"""Figures that a page quotes from another one: none is older than the page that the benchmark writes."""

import re

import pytest

from benchmarks.summary import find

FRUIT = ("strawberry", "raspberry", "blueberry")
PACE = {
    "fruit a minute": ("fruit a minute", 0),
    "trigger to outcome, s": ("to outcome, s", 1),
    "to the next trigger, s": ("to next trigger, s", 1),
}
"""The cycle time's column for each of the pace's, and the decimals that the pace keeps."""


@pytest.fixture
def text(root):
    """A page's text by its path."""
    return lambda name: (root / name).read_text("utf-8")


def block(page, name):
    """Return the text that a benchmark has written between its marks."""
    [found] = re.findall(rf"<!-- {name} -->\n(.*?)<!-- /{name} -->", page, re.DOTALL)
    return found


def figures_of(page, pattern):
    """The numbers of the one sentence of a page that has this form."""
    [found] = re.findall(pattern, re.sub(r"\s+", " ", page))
    return [float(each.replace(",", "")) for each in ([found] if isinstance(found, str) else found)]


@pytest.mark.parametrize("page", ["README.md", "docs/plc/index.md"])
@pytest.mark.parametrize("fruit", FRUIT)
def test_the_pace_is_the_cycle_times(text, page, fruit):
    for column, (source, decimals) in PACE.items():
        quoted = float(find(block(text(page), "pace"), {column}, fruit, column))
        measured = float(find(text("docs/cycle-time.md"), {"to outcome, s"}, fruit, source))
        assert quoted == pytest.approx(measured, abs=0.56 * 10**-decimals), "but for both pages' rounding"


def test_the_readmes_errors_are_the_sorting_pages(text):
    assert block(text("README.md"), "errors") == block(text("docs/sorting.md"), "errors")


def test_the_readmes_compressed_draws_are_all_that_were_made_and_none_had_an_area(text):
    page, columns = text("docs/measurement.md"), {"compression", "draws", "with a false area"}
    kinds = ("JPEG 30", "JPEG 45", "JPEG 60", "video")
    assert [find(page, columns, kind, "with a false area") for kind in kinds] == ["0"] * 4
    draws = sum(int(find(page, columns, kind, "draws")) for kind in kinds)
    assert figures_of(text("README.md"), r"None of ([\d,]+) such draws, compressed") == [draws]


def test_the_readmes_error_of_the_area_is_the_range_of_the_sound_fruit(text):
    sound = text("docs/measurement.md").partition("## The robust method on the twin")[2].partition("\n## ")[0]
    column = "error of the area: median"
    errors = [100 * float(find(sound, {column}, fruit, column)) for fruit in FRUIT]
    low, high = figures_of(text("README.md"), r"the area's median error is (\d+) to (\d+) % by kind")
    assert (low, high) == (round(min(errors)), round(max(errors)))


def test_calibrations_spread_is_that_of_the_units(text):
    column = "standard deviation"
    units, spread = figures_of(
        text("docs/calibration.md"), r"Over (\d+) units .*? off by ([\d.]+) %, one standard deviation"
    )
    table = block(text("docs/sorting.md"), "calibrations")
    assert find(table, {column}, f"{units:.0f} |", column) == f"{spread}%"
