"""The check that an area does not shrink while the gripper closes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.monotone import WrongFrame, wrong_frames

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


def test_the_last_frames_are_named_where_they_fall_out():
    assert [frame.index for frame in wrong_frames(WIDTHS, [0, 100, 220, 350, 20, 30])] == [4, 5]


def test_noise_and_opening_again_are_not_wrong():
    assert wrong_frames(WIDTHS, [0, 100, 98, 350, 340, 640]) == []
    assert wrong_frames([20, 19, 18, 19, 20], [0, 100, 200, 90, 0]) == []
    assert wrong_frames([20, 19, 19], [0, 100, 50]) == []


@pytest.mark.parametrize(("area", "wrong"), [(95.0, []), (94.9, [0])])
def test_an_area_may_fall_by_a_twentieth(area, wrong):
    assert [frame.index for frame in wrong_frames([20, 19], [100, area])] == wrong


def test_many_small_falls_are_no_noise_together():
    assert [frame.index for frame in wrong_frames([20, 19, 18], [100, 96, 92])] == [2]


def test_no_fall_of_a_small_area_is_noise_by_itself():
    assert [frame.index for frame in wrong_frames([20, 19], [0.5, 0.0])] == [0]
    assert wrong_frames([20, 19], [0.5, 0.0], least_noise=0.5) == []


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


def plainly(widths: list[float], areas: list[float], relative: float, least: float) -> list[WrongFrame]:
    """The definition written out, without a thought for its cost: every run is kept whole."""
    closing = [place for place, width in enumerate(widths) if all(width < earlier for earlier in widths[:place])]
    slack = {place: max(least, relative * areas[place]) for place in closing}
    runs: list[list[int]] = []
    for place in closing:
        fitting = [run for run in runs if all(areas[place] >= areas[k] - slack[k] for k in run)]
        runs.append([*max(fitting, key=len, default=[]), place])
    kept = max(reversed(runs), key=len, default=[])
    return [
        WrongFrame(
            place,
            areas[place],
            max((areas[k] - slack[k] for k in kept if k < place), default=0.0),
            min((areas[k] + slack[k] for k in kept if k > place), default=float("inf")),
        )
        for place in closing
        if place not in kept
    ]


# Few different values beside any: ties between runs are where two ways of finding the longest would differ.
AREAS = st.one_of(st.integers(0, 8).map(lambda tens: 10.0 * tens), st.floats(-10, 1e5))
STEPS = st.lists(st.tuples(st.one_of(st.integers(0, 40).map(float), st.floats(0, 85)), AREAS), max_size=40)


@given(STEPS, st.sampled_from([0.0, 0.05, 0.3]), st.sampled_from([0.0, 5.0]))
def test_the_result_is_the_definitions(steps, relative, least):
    widths, areas = [width for width, _ in steps], [area for _, area in steps]
    assert wrong_frames(widths, areas, relative, least) == plainly(widths, areas, relative, least)


@given(st.lists(AREAS, max_size=40), st.sampled_from([0.0, 0.05, 0.3]), st.sampled_from([0.0, 5.0]))
def test_the_result_is_the_definitions_while_it_closes(areas, relative, least):
    widths = [50.0 - step for step in range(len(areas))]
    assert wrong_frames(widths, areas, relative, least) == plainly(widths, areas, relative, least)
