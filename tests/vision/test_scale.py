"""Pixels to square millimetres, and the agreement of frames."""

import pytest

from station.vision.confidence import agreement
from station.vision.scale import Scale


def test_the_same_contact_has_one_area_at_every_size():
    large, small = Scale.typical(640, 480), Scale.typical(240, 320)
    assert large.area_mm2(4000) == pytest.approx(small.area_mm2(1000))
    area, uncertainty = large.area_mm2(5000)
    assert area == pytest.approx(3.54, abs=0.01)
    assert uncertainty == pytest.approx(0.3 * area)


def test_an_empty_image_has_no_scale():
    with pytest.raises(ValueError, match="must be positive"):
        Scale.typical(0, 480)


def test_frames_that_agree_give_confidence():
    assert agreement([1000]) == agreement([0, 0]) == 1
    assert 1 > agreement([1000, 1010, 990]) > agreement([1000, 1100, 900]) > agreement([1000, 2000, 100])
    with pytest.raises(ValueError, match="at least one"):
        agreement([])
