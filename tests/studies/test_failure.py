"""When a sample counts as failed, who is in a cohort, and how sure a share is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from station.binomial import clopper_pearson
from station.studies.cohort import FRUITS, RESULT_CLOSINGS_MM, member, paper_sizes
from station.studies.failure import Cause, failures
from station.twin.fruit import Kind

CLOSINGS = [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0]
TRUTH = [0.0, 0.0, 10.0, 20.0, 30.0, 40.0]
RESULTS = (2.0, 4.0)


def judged(*areas: float, from_mm: float | None = None) -> frozenset[Cause]:
    return failures(CLOSINGS, areas, TRUTH, RESULTS, from_mm=from_mm)


def test_the_truth_does_not_fail():
    assert judged(*TRUTH) == frozenset()


def test_nothing_found_is_a_failure():
    assert judged(0, 0, 0, 0, 0, 0) == {Cause.NO_CONTACT}


@pytest.mark.parametrize(("fallen", "fails"), [(27.1, False), (26.9, True), (0.0, True)])
def test_a_fall_beyond_a_tenth_of_the_running_maximum_fails(fallen, fails):
    assert (Cause.FALLING_AREA in judged(0, 0, 10, 30, fallen, 40)) == fails


def test_falls_add_up_against_the_maximum():
    """Each step falls by less than a tenth, all of them by more."""
    assert Cause.FALLING_AREA in judged(0, 0, 40, 38, 36.5, 35)


@pytest.mark.parametrize(("area", "fails"), [(59, False), (61, True), (21, False), (19, True)])
def test_an_area_wrong_by_more_than_half_at_a_result_fails(area, fails):
    found = judged(0, 0, 5, 12, 15, area)
    assert (Cause.WRONG_AREA in found) == fails


def test_an_area_wrong_elsewhere_does_not_fail():
    assert judged(0, 0, 1, 20, 60, 59) == frozenset()


def test_false_area_before_the_touch_makes_the_true_contact_a_fall():
    assert judged(50, 50, 10, 20, 30, 40) == {Cause.FALLING_AREA}
    assert judged(50, 50, 10, 20, 30, 40, from_mm=2.0) == frozenset()


@pytest.mark.parametrize("kind", FRUITS)
def test_results_are_at_the_images_nearest_to_them(kind):
    closings = np.array(member(kind, 0, 5).closings_mm)
    for wanted in RESULT_CLOSINGS_MM[Kind(kind)]:
        assert np.abs(closings - wanted).min() <= 0.5


@pytest.mark.parametrize("kind", [Kind.STRAWBERRY, Kind.BLUEBERRY, Kind.RASPBERRY])
def test_a_cohort_has_the_papers_sizes_and_a_flesh_of_each_ones_own(kind):
    sizes = paper_sizes()[kind]
    members = [member(kind, 3, number) for number in range(33)]
    assert len(sizes) == 30
    drawn = [(one.fruit.weight_g, one.fruit.length_mm, one.fruit.width_mm) for one in members]
    assert drawn == [*sizes, *sizes[:3]]
    assert len({one.fruit.modulus_mpa for one in members}) == 33
    assert len({one.pose for one in members}) == 33
    assert all(len(one.closings_mm) == 20 for one in members)
    assert member(kind, 3, 7) == members[7]
    assert member(kind, 4, 7) != members[7]


def test_the_ball_is_closed_to_the_papers_widths():
    ball = member("rubber_ball", 0, 0)
    assert [42.0 - closing for closing in ball.closings_mm] == list(range(46, 32, -1))
    assert ball.fruit.width_mm == 24


@given(st.integers(1, 400), st.data())
@settings(max_examples=50, deadline=None)
def test_an_interval_holds_what_is_not_surprising(of, data):
    count = data.draw(st.integers(0, of))
    low, high = clopper_pearson(count, of)
    assert 0 <= low <= count / of <= high <= 1
    if count:
        assert binom.sf(count - 1, of, low) == pytest.approx(0.025, rel=1e-3)
    if count < of:
        assert binom.cdf(count, of, high) == pytest.approx(0.025, rel=1e-3)
