"""The age of a state by its timestamp."""

from hypothesis import given
from hypothesis import strategies as st

from station.devices.arm.age import TimestampAge


@given(st.floats(-1e6, 1e6), st.lists(st.floats(0.0, 0.004), min_size=5, max_size=50))
def test_a_live_stream_is_as_old_as_it_came_late(zero_s, delays_s):
    age = TimestampAge()
    for i, delay_s in enumerate(delays_s):
        sent_s = 0.002 * i
        assert 0.0 <= age.age_s(sent_s + zero_s, sent_s + delay_s) <= 0.004 + 1e-6


@given(st.floats(0.0, 20.0))
def test_a_frozen_stream_ages_with_our_clock(frozen_s):
    age = TimestampAge()
    age.age_s(100.0, 5.0)
    assert abs(age.age_s(100.0, 5.0 + frozen_s) - frozen_s) < 1e-9


@given(st.floats(0.05, 20.0))
def test_a_stream_that_comes_late_shows_how_late(late_s):
    age = TimestampAge()
    ages = [age.age_s(0.1 * i - (late_s if i > 10 else 0.0), 0.1 * i) for i in range(30)]
    assert max(ages[:11]) < 1e-9
    assert min(ages[11:]) > late_s - 1e-6


def test_clocks_that_drift_apart_do_not_make_it_old():
    age = TimestampAge()
    ages = [age.age_s(0.1 * i * (1 - 100e-6), 0.1 * i) for i in range(36_000)]
    assert max(ages) < 0.005


def test_a_clock_that_was_set_ahead_starts_anew():
    age = TimestampAge()
    age.age_s(1.0, 1.0)
    assert age.age_s(6.1, 1.1) == 0.0
    assert abs(age.age_s(6.1, 1.3) - 0.2) < 1e-9
