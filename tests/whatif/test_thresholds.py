"""The threshold assistant: the limits reject as many good fruit as was wanted, and it says how unsure that is."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.inspection.judge import judge
from station.settings.recipe import load_recipe
from station.whatif.limits import fewest_good, propose, quantile_interval, rate_interval


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(1, 200), min_size=1, max_size=300), st.floats(0.001, 0.5))
def test_a_limit_rejects_no_more_good_fruit_than_was_wanted(values, rate):
    limit = propose([*values, None], [150.0, None], 3.0, rate)
    assert limit is not None
    assert sum(value > limit.value for value in values) <= rate * len(values)
    assert limit.unknown == 2
    low, high = limit.interval.low, limit.interval.high
    assert low is None or low <= limit.value
    assert high is None or high >= limit.value
    if len(values) < fewest_good(rate):
        assert high is None, "too few to say"


def test_the_interval_covers_the_true_quantile_as_often_as_it_says():
    random, covered = np.random.default_rng(4), 0
    for _ in range(400):
        interval = quantile_interval(sorted(random.uniform(0, 1, 200)), 0.95)
        covered += interval.low is not None and interval.high is not None and interval.low <= 0.95 <= interval.high
    assert covered >= 0.93 * 400


def test_a_rate_of_none_seen_is_not_nought():
    interval = rate_interval(0, 50)
    assert interval.low == 0
    assert interval.high == pytest.approx(0.0711, abs=0.0005), "1 - 0.025 ** (1 / 50)"


def test_limits_are_proposed_from_marked_fruit_and_written_as_a_draft(orchard, draft, station, tmp_path):
    growths = [25 + number / 10 for number in range(40)] + [40.0 + number for number in range(5)]
    made = orchard.store([orchard.press(growth, seed=number) for number, growth in enumerate(growths)])
    marks = tmp_path / "marks.csv"
    words = ["good"] * 40 + ["bad"] * 5
    rows = "".join(f"{sequence},{word}\n" for sequence, word in zip(made, words, strict=True))
    marks.write_text("sequence,mark\n" + rows + "9999,good\n")
    out, file = tmp_path / "out", tmp_path / "proposed.yaml"
    arguments = ("thresholds", "--recipe", "strawberry", "--marks", marks, "--out", out, "--draft", file)
    code, told = station(*arguments, "--false-rejects", "0.1")
    assert code == 0
    assert "good fruit are needed for the interval's upper end" in told
    figures = json.loads((out / "thresholds.json").read_text())
    area, growth = figures["limits"]
    assert area["closing_mm"] == 3
    assert (area["good"], area["bad"], growth["unit"]) == (40, 5, "mm²/mm")
    guard = 1 + judge(orchard.press(28), orchard.recipe).budget.expanded
    assert 3 * 28 * guard < area["limit"] < 3 * 29.5 * guard
    proposed = load_recipe(file)
    assert area["limit"] <= proposed.damage.area[0].area_mm2 < area["limit"] + 0.5
    assert "# the paper" in file.read_text(), "comments are kept"
    rates = figures["by_the_proposed_recipe"]
    assert rates["bad"]["rejected"] == 5
    assert rates["good"]["rejected"] <= 4
    assert (out / "thresholds.html").read_text().count("data:image/png") == 2
    again = ("thresholds", "--recipe", "strawberry", "--out", tmp_path / "again", "--false-rejects", "0.1")
    code, told = station(*again)
    assert (code, "no fruit is marked" in told) == (2, True)
    for word, some in (("good", made[:40]), ("bad", made[40:])):
        assert station("records", "mark", *some, word)[0] == 0
    assert station(*again)[0] == 0
    assert json.loads((tmp_path / "again" / "thresholds.json").read_text()) == figures, "as from the table"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("a,b\n", ":1: expected the header sequence,mark"),
        ("sequence,mark\n1,fine\n", ":2: mark: expected good or bad, got 'fine'"),
        ("sequence,mark\nx,good\n", ":2: sequence: expected an inspection's number"),
        ("sequence,mark\n1,good\n1,bad\n", ":3: 1 is marked good and bad"),
        ("sequence,mark\n1,bad\n", "none of the fruit marked good"),
        ("\x00", "expected"),
    ],
)
def test_bad_marks_are_told(orchard, station, tmp_path, content, told):
    orchard.store([orchard.press(27.0)])
    marks = tmp_path / "marks.csv"
    marks.write_text(content)
    code, said = station("thresholds", "--recipe", "strawberry", "--marks", marks, "--out", tmp_path / "out")
    assert code == 2
    assert told in said
