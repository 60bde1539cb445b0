"""The check that an area does not shrink while the gripper closes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.monotone import wrong_frames

WIDTHS = [20.0, 19.0, 18.0, 17.0, 16.0, 15.0]


def test_a_growing_area_is_right():
    assert wrong_frames(WIDTHS, [0, 100, 220, 350, 500, 640]) == []


@pytest.mark.parametrize("bad", [(3, 20.0), (2, 5000.0)])
def test_the_frame_that_falls_out_is_named_and_nothing_else(bad):
    areas = [0.0, 100, 220, 350, 500, 640]
    areas[bad[0]] = bad[1]
    (wrong,) = wrong_frames(WIDTHS, areas)
    assert (wrong.index, wrong.area) == bad
    assert not wrong.expected_low <= wrong.area <= wrong.expected_high


def test_noise_and_opening_again_are_not_wrong():
    assert wrong_frames(WIDTHS, [0, 100, 98, 350, 340, 640]) == []
    assert wrong_frames([20, 19, 18, 19, 20], [0, 100, 200, 90, 0]) == []


@given(st.lists(st.floats(0, 1e5), min_size=1, max_size=25))
def test_what_is_left_never_shrinks(areas):
    widths = [50.0 - step for step in range(len(areas))]
    wrong = {frame.index for frame in wrong_frames(widths, areas)}
    left = [area for index, area in enumerate(areas) if index not in wrong]
    assert left
    assert all(later >= 0.95 * max(left[:place]) for place, later in enumerate(left) if place)


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(ValueError, match="one width for each"):
        wrong_frames([1.0], [1.0, 2.0])
    with pytest.raises(ValueError, match="finite"):
        wrong_frames([1.0], [float("nan")])
