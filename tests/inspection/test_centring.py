"""Centring: how far a contact is off the middle, and how far the sensor may follow."""

import pytest

from station.inspection.centring import NOT_MOVED, Offset, off_middle, too_far

SHAPE = (640, 480, 3)


def test_right_and_down_in_the_image_are_positive():
    assert off_middle((239.5, 319.5), SHAPE, 0.0266) == NOT_MOVED
    assert off_middle((249.5, 299.5), SHAPE, 0.03) == pytest.approx((0.3, -0.6))


def test_the_bound_is_counted_from_the_taught_place():
    assert not too_far(Offset(1.8, 2.4), NOT_MOVED, 3.0)
    assert too_far(Offset(1.8, 2.5), NOT_MOVED, 3.0)
    assert too_far(Offset(1.0, 0.0), Offset(2.5, 0.0), 3.0)
    assert not too_far(Offset(-1.0, 0.0), Offset(2.5, 0.0), 3.0)
    assert too_far(Offset(0.4, 0.0), NOT_MOVED, 0.0)
