"""The check that an area does not shrink while the gripper closes."""

from itertools import combinations

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
    assert [frame.index for frame in wrong_frames([20, 19, 18], [100, 96, 92])] == [0], "the later two fit each other"


def test_the_frame_that_is_too_large_is_named_and_not_those_that_fit_each_other():
    (wrong,) = wrong_frames([5, 4, 3, 2, 1], [100, 90, 96, 94, 99])
    assert (wrong.index, wrong.area) == (0, 100)


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


def longest(areas: list[float], floors: dict[int, float], places: list[int], most: float) -> int:
    """The length of the longest run among the places whose floors are at most so much."""
    lowest = [float("-inf")]
    for place in places:
        if floors[place] > most:
            continue
        for length in reversed([length for length, floor in enumerate(lowest) if areas[place] >= floor]):
            highest = max(lowest[length], floors[place])
            lowest[length + 1 :] = [min([highest, *lowest[length + 1 : length + 2]]), *lowest[length + 2 :]]
    return len(lowest) - 1


def plainly(widths: list[float], areas: list[float], relative: float, least: float) -> list[WrongFrame]:
    """The definition written out, not made fast: a frame is consistent if a longest run goes on before it.

    The last one is the latest such frame, and each before it the earliest.
    """
    closing = [place for place, width in enumerate(widths) if all(width < earlier for earlier in widths[:place])]
    slack = {place: max(least, relative * areas[place]) for place in closing}
    floors = {place: areas[place] - slack[place] for place in closing}
    consistent, most = list[int](), float("inf")
    for length in reversed(range(longest(areas, floors, closing, most))):
        before = [place for place in closing if not consistent or place < consistent[0]]
        fitting = [
            place
            for number, place in enumerate(before)
            if floors[place] <= most and longest(areas, floors, before[:number], min(most, areas[place])) >= length
        ]
        consistent.insert(0, fitting[0] if consistent else fitting[-1])
        most = min(most, areas[consistent[0]])
    return [
        WrongFrame(
            place,
            areas[place],
            max((areas[k] - slack[k] for k in consistent if k < place), default=0.0),
            min((areas[k] + slack[k] for k in consistent if k > place), default=float("inf")),
        )
        for place in closing
        if place not in consistent
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


@given(st.lists(AREAS, max_size=8), st.sampled_from([0.0, 0.05, 0.3]), st.sampled_from([0.0, 5.0]))
def test_no_other_frames_of_the_same_number_or_fewer_would_be_enough_or_come_first(areas, relative, least):
    """Of all sets of frames that fit each other: the largest, of these one that ends last, then the earliest frames."""
    floors = [area - max(least, relative * area) for area in areas]

    def fit(places: tuple[int, ...]) -> bool:
        return all(areas[later] >= floors[place] for place, later in combinations(places, 2))

    def order(places: tuple[int, ...]) -> tuple[int, ...]:
        return len(places), *places[-1:], *(-place for place in places[-2::-1])

    every = (places for number in range(len(areas) + 1) for places in combinations(range(len(areas)), number))
    consistent = max(filter(fit, every), key=order)
    named = [frame.index for frame in wrong_frames([50.0 - step for step in range(len(areas))], areas, relative, least)]
    assert named == [place for place in range(len(areas)) if place not in consistent]
