"""Limits that a person moves on the recipe's page, tried on past fruit and against people's marks."""

import pytest

from hmi.past.tried import read_tried


def test_a_moved_limit_is_tried_on_the_last_fruit_and_against_the_marks(orchard, changed, station):
    """Good fruit well under the limit, bad ones well over it; one good and one bad are of the other's area."""
    growths = [27.0] * 6 + [60.0] + [60.0] * 3 + [27.0]
    made = orchard.store([orchard.press(growth, seed=number) for number, growth in enumerate(growths)])
    before = read_tried(orchard.folder, orchard.recipe)
    assert before is not None
    assert (before.last, before.decided, before.diverted_before, before.diverted_after) == (11, 11, 4, 4)
    assert (before.against, before.errors) == (None, ()), "nothing is marked"
    assert station("records", "mark", *made[:7], "good")[0] == 0
    assert station("records", "mark", *made[7:], "bad")[0] == 0

    lower = changed(orchard.recipe, damage__area__0__area_mm2=60.0, damage__area__0__least_area_mm2=20.0)
    tried = read_tried(orchard.folder, lower)
    assert tried is not None
    assert (tried.decided, tried.diverted_before, tried.diverted_after) == (11, 4, 11)
    good, bad = tried.errors
    assert (good.name, good.of, good.before, good.after) == ("good", 7, 1, 7)
    assert (bad.name, bad.of, bad.before, bad.after) == ("bad", 4, 1, 0)
    assert good.interval.low == pytest.approx(0.59, abs=0.005), "0.025 ** (1 / 7)"
    assert tried.against is not None
    assert (tried.against.now_right, tried.against.now_wrong) == ((made[-1],), tuple(made[:6]))


def test_there_is_nothing_to_try_a_limit_on_before_the_first_fruit(orchard):
    orchard.store([])
    assert read_tried(orchard.folder, orchard.recipe) is None


def test_what_a_limit_cannot_be_known_of_is_in_neither_error(orchard, changed, station):
    """The steps ended early, and a limit so much higher would have pressed on."""
    made = orchard.store([orchard.press(60.0), orchard.press(27.0)])
    assert station("records", "mark", *made, "bad")[0] == 0
    higher = changed(
        orchard.recipe,
        damage__area__0__area_mm2=250.0, early_stop__area_mm2=260.0, damage__growth_mm2_per_mm=200.0,
        early_stop__growth_mm2_per_mm=250.0,
    )  # fmt: skip
    tried = read_tried(orchard.folder, higher)
    assert tried is not None
    assert tried.against is not None
    assert (tried.decided, tried.against.bad, tried.against.undecided) == (0, 0, 2)
    assert [each.interval.low for each in tried.errors] == [None, None]
