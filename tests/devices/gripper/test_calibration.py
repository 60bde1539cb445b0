"""Millimetres, newtons and counts: properties over every finger set."""

from math import nan

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from station.devices.gripper.calibration import (
    count_for_width,
    force_setting,
    max_width_mm,
    speed_setting,
    width_of_count,
)
from station.devices.gripper.errors import GripperRequestError
from station.messages import gripper as messages
from station.settings.gripper import GripperCalibration


@st.composite
def finger_sets(draw: st.DrawFn) -> GripperCalibration:
    open_count, closed_count = draw(st.integers(0, 20)), draw(st.integers(200, 255))
    mm_per_count = draw(st.floats(0.3, 0.7))
    offset_mm = draw(st.floats(0.0, 50.0))
    return GripperCalibration(
        open_count=open_count, closed_count=closed_count, mm_per_count=mm_per_count, finger_offset_mm=offset_mm
    )


@given(finger_sets(), st.floats(0.0, 1.0))
def test_a_requested_width_is_met_within_half_a_count(fingers: GripperCalibration, part: float):
    width_mm = part * max_width_mm(fingers)
    count = count_for_width(width_mm, fingers)
    assert fingers.open_count <= count <= fingers.closed_count
    assert abs(width_of_count(count, fingers) - width_mm) <= fingers.mm_per_count / 2 + 1e-6


@given(finger_sets(), st.integers(0, 255))
def test_a_measured_width_leads_back_to_its_count(fingers: GripperCalibration, count: int):
    width_mm = width_of_count(count, fingers)
    assume(0.0 <= width_mm <= max_width_mm(fingers))
    assert count_for_width(width_mm, fingers) == count


@given(finger_sets(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_wider_request_never_closes_further(fingers: GripperCalibration, one: float, other: float):
    narrow, wide = sorted((one * max_width_mm(fingers), other * max_width_mm(fingers)))
    assert count_for_width(wide, fingers) <= count_for_width(narrow, fingers)


def test_a_tie_goes_to_the_wider_gap():
    fingers = GripperCalibration(open_count=0, closed_count=200, mm_per_count=0.5, finger_offset_mm=30.0)
    assert count_for_width(10.25, fingers) == 119
    assert width_of_count(119, fingers) == 10.5


def test_the_digit_leaves_53_mm_of_the_85():
    fingers = GripperCalibration()
    assert max_width_mm(fingers) == pytest.approx(53.0)
    assert width_of_count(230, fingers) == pytest.approx(-32.0)


@pytest.mark.parametrize("width_mm", [-0.1, 53.1, nan])
def test_a_width_out_of_reach_is_refused_with_the_reach(width_mm: float):
    with pytest.raises(GripperRequestError) as caught:
        count_for_width(width_mm, GripperCalibration())
    assert caught.value.cause.id == messages.WIDTH_OUT_OF_REACH.id
    assert caught.value.cause.parameters["widest_mm"] == pytest.approx(53.0)


def test_fingers_that_leave_no_room_are_refused():
    with pytest.raises(ValidationError, match="leave no room"):
        GripperCalibration(mm_per_count=0.2, finger_offset_mm=60.0)


@pytest.mark.parametrize(("speed_mm_s", "setting"), [(20.0, 0), (150.0, 255), (85.0, 128)])
def test_speed_spans_its_scale(speed_mm_s: float, setting: int):
    assert speed_setting(speed_mm_s) == setting


@given(st.floats(20.0, 235.0))
def test_a_force_setting_never_means_more_than_was_asked(force_n: float):
    meant_n = 20.0 + force_setting(force_n) / 255 * 215.0
    assert force_n - 215.0 / 255 <= meant_n + 1e-6
    assert meant_n <= force_n + 1e-6


@pytest.mark.parametrize("force_n", [0.0, 19.9, 235.1, nan])
def test_a_force_out_of_range_is_refused(force_n: float):
    with pytest.raises(GripperRequestError) as caught:
        force_setting(force_n)
    cause = caught.value.cause
    assert cause.id == messages.FORCE_OUT_OF_RANGE.id
    assert (cause.parameters["weakest_n"], cause.parameters["strongest_n"]) == (20.0, 235.0)


@pytest.mark.parametrize("speed_mm_s", [0.0, 19.0, 151.0, nan])
def test_a_speed_out_of_range_is_refused(speed_mm_s: float):
    with pytest.raises(GripperRequestError) as caught:
        speed_setting(speed_mm_s)
    cause = caught.value.cause
    assert cause.id == messages.SPEED_OUT_OF_RANGE.id
    assert (cause.parameters["slowest_mm_s"], cause.parameters["fastest_mm_s"]) == (20.0, 150.0)
