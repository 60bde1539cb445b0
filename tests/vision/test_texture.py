"""Texture segmentation: what is pressed in, and the level from which on it is."""

import numpy as np
import pytest

from station.vision.constants import CONSTANTS
from station.vision.texture import element_level, union

SHAPE = (320, 240)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def disc(radius, x=120.0, y=160.0):
    return np.where(np.hypot(COLUMNS - x, ROWS - y) <= radius, 255, 0).astype(np.uint8)


def hertz(radius, levels, x=120.0, y=160.0):
    """The slope's size around a smooth contact: Johnson's dent outside it, differentiated by steps."""
    ratio = np.hypot(COLUMNS - x, ROWS - y) / radius

    def dent(q):
        return ((2 - q**2) * np.arcsin(1 / q) + np.sqrt(q**2 - 1)) / np.pi

    outside = np.maximum(ratio, 1.001)
    slope = (dent(outside) - dent(outside + 1e-4)) / 1e-4
    return (levels * np.where(ratio < 1, ratio, slope)).astype(np.float32)


def level(length, region, coherence):
    return element_level(length, region, coherence, CONSTANTS)


def test_few_drupelets_are_their_union_and_not_their_hull():
    drupelets = [(90.0, 135.0), (150.0, 135.0), (120.0, 190.0)]
    length = np.max([hertz(16, 30, x, y) * (disc(16, x, y) > 0) for x, y in drupelets], axis=0).astype(np.float32)
    apart = np.max([disc(16, x, y) for x, y in drupelets], axis=0)
    hull = disc(55, 120.0, 152.0)
    found, _ = union(length, hull, level(length, hull, 0.5), CONSTANTS)
    assert np.count_nonzero(found) == pytest.approx(np.count_nonzero(apart), rel=0.3)
    assert np.count_nonzero(found) < 0.4 * np.count_nonzero(hull)
    assert np.count_nonzero(found & apart) > 0.85 * np.count_nonzero(apart)


def test_the_more_directions_agree_the_higher_an_element_ends():
    length = np.full(SHAPE, 20.0, np.float32)
    assert level(length, disc(75), 0.6) > 1.5 * level(length, disc(75), 0.2)


def test_of_few_elements_each_ends_at_half_its_height_whatever_the_directions():
    length = np.full(SHAPE, 20.0, np.float32)
    assert level(length, disc(30), 0.1) == level(length, disc(30), 0.3) == pytest.approx(10, rel=0.1)
    assert level(length, disc(75), 0.1) < 0.5 * level(length, disc(30), 0.1)


def test_an_area_that_depends_on_its_level_is_less_sure():
    steep = 20.0 * (disc(40) > 0).astype(np.float32)
    gentle = np.maximum(0, 20 - 0.3 * np.hypot(COLUMNS - 120, ROWS - 160)).astype(np.float32)
    sure, unsure = (union(length, disc(70), 8.0, CONSTANTS)[1] for length in (steep, gentle))
    assert sure > 0.9
    assert unsure < 0.6
