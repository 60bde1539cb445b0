"""The area curve."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.curve import Reading, area_curve

READINGS = st.lists(
    st.builds(
        Reading,
        width_mm=st.floats(0, 85),
        area_px=st.integers(0, 307_200),
        area_mm2=st.floats(0, 217),
        counts=st.booleans(),
    ),
    max_size=30,
)


def test_closing_counts_from_the_first_contact():
    readings = [
        Reading(44, 0, 0.0, counts=False),
        Reading(42.8, 900, 0.6, counts=True),
        Reading(43.2, 0, 0.0, counts=False),
        Reading(42.0, 2000, 1.4, counts=True),
    ]
    curve = area_curve(readings)
    assert curve.onset_mm == 42.8
    assert [point.closing_mm for point in curve.points] == pytest.approx([-1.2, -0.4, 0.0, 0.8])
    assert [point.reading.area_px for point in curve.points] == [0, 0, 900, 2000]


def test_closing_does_not_count_from_a_light_touch():
    curve = area_curve([Reading(45, 700, 0.5, counts=False), Reading(43, 2000, 1.4, counts=True)])
    assert curve.onset_mm == 43
    assert [point.closing_mm for point in curve.points] == [-2, 0]


def test_without_contact_there_is_no_closing():
    curve = area_curve([Reading(44, 0, 0.0, counts=False), Reading(43, 0, 0.0, counts=False)])
    assert curve.onset_mm is None
    assert curve.points == ()


@given(readings=READINGS)
def test_every_reading_is_kept_in_the_order_of_closing(readings):
    curve = area_curve(readings)
    assert (curve.onset_mm is None) == (not any(reading.counts for reading in readings))
    if curve.onset_mm is not None:
        assert sorted(map(id, readings)) == sorted(id(point.reading) for point in curve.points)
        closings = [point.closing_mm for point in curve.points]
        assert closings == sorted(closings)
        touched = [point for point in curve.points if point.reading.counts]
        assert touched[0].closing_mm == 0
        assert all(point.closing_mm >= 0 for point in touched)
