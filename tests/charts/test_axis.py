"""Axes: round numbers that reach every value, and positions in their order."""

from hypothesis import example, given
from hypothesis import strategies as st

from station.charts.axis import Axis, ticks


@given(st.floats(-50, 0), st.floats(0.01, 1e4), st.integers(2, 8))
@example(-40.015625, 0.015625, 2)
def test_ticks_are_few_round_numbers_that_enclose_all_values(least, most, intervals):
    made = [tick.value for tick in ticks(least, most, intervals)]
    step = made[1] - made[0]
    slack = 1e-6 * (most - least)
    assert made[0] <= least + slack
    assert most <= made[-1] + slack
    assert made[0] > least - step
    assert made[-1] < most + step
    assert 2 <= len(made) <= intervals + 2


@given(st.floats(0.01, 1e4))
def test_every_tick_is_written_with_all_of_its_digits(most):
    for tick in ticks(0.0, most, 6):
        assert abs(float(f"{tick.value:.{tick.digits}f}") - tick.value) <= 1e-6 * most


@given(st.lists(st.floats(-10, 200), min_size=2), st.booleans())
def test_positions_are_in_the_values_order_and_within_the_axis(values, reversed_axis):
    begin, end = (300.0, 20.0) if reversed_axis else (20.0, 300.0)
    axis = Axis(0.0, 100.0, begin, end, 6)
    positions = [axis(value) for value in sorted(values)]
    assert positions == sorted(positions, reverse=reversed_axis)
    assert all(20 <= at <= 300 for at in positions)
