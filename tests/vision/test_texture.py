"""Texture segmentation: what is pressed in, and the level from which on it is."""

import numpy as np
import pytest

from station.vision.constants import CONSTANTS
from station.vision.contour import Rays
from station.vision.region import Region
from station.vision.texture import element_level, noise_level, union

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


def textured(coherence):
    nothing = np.zeros((160, 120), np.uint8)
    rays = Rays((60.0, 80.0), np.eye(2))
    return Region(nothing, rays, np.zeros(64), nothing.astype(np.float32), 1.0, coherence, textured=True)


def level(length, region, coherence, noise=0.0):
    return element_level(length, region, textured(coherence), noise, CONSTANTS)


def test_few_drupelets_are_their_union_and_not_their_hull():
    drupelets = [(90.0, 135.0), (150.0, 135.0), (120.0, 190.0)]
    length = np.max([hertz(16, 30, x, y) * (disc(16, x, y) > 0) for x, y in drupelets], axis=0).astype(np.float32)
    apart = np.max([disc(16, x, y) for x, y in drupelets], axis=0)
    hull = disc(55, 120.0, 152.0)
    found, _ = union(length, hull, level(length, hull, 0.5), 0.0, CONSTANTS)
    assert np.count_nonzero(found) == pytest.approx(np.count_nonzero(apart), rel=0.3)
    assert np.count_nonzero(found) < 0.4 * np.count_nonzero(hull)
    assert np.count_nonzero(found & apart) > 0.85 * np.count_nonzero(apart)


def test_a_lone_element_ends_higher_than_the_outermost_of_many():
    length = np.full(SHAPE, 20.0, np.float32)
    few, many = (level(length, disc(radius), 0.2).max() for radius in (20, 75))
    p = CONSTANTS
    assert few == pytest.approx(20 * (p.element_random + 0.2 * p.element_coherent + p.element_few))
    assert many == pytest.approx(20 * (p.element_random + 0.2 * p.element_coherent))
    assert few > 1.5 * many


def test_the_more_directions_agree_the_higher_an_element_ends():
    length = np.full(SHAPE, 20.0, np.float32)
    assert level(length, disc(75), 0.6).min() > level(length, disc(75), 0.2).max()


def test_an_area_that_depends_on_its_level_is_less_sure():
    steep = 20.0 * (disc(40) > 0).astype(np.float32)
    gentle = np.maximum(0, 20 - 0.3 * np.hypot(COLUMNS - 120, ROWS - 160)).astype(np.float32)
    level_8 = np.full(SHAPE, 8, np.float32)
    sure, unsure = (union(length, disc(70), level_8, 0.0, CONSTANTS)[1] for length in (steep, gentle))
    assert sure > 0.9
    assert unsure < 0.6


def test_the_fainter_a_body_the_more_its_region_decides_where_it_ends():
    region = disc(60)
    faint, clear = (level(np.full(SHAPE, strong, np.float32), region, 0.3, 2.0) for strong in (6.0, 200.0))
    middle, edge, beyond = ((160, column) for column in (120, 180, 188))
    assert faint[middle] < 0.2 * faint[edge] < 0.2 * faint[beyond]
    assert clear[middle] == pytest.approx(clear[beyond], rel=0.05)


def test_noise_is_no_element():
    found = level(np.full(SHAPE, 6.0, np.float32), disc(60), 0.3, 2.0)
    assert found[160, 168] == pytest.approx(CONSTANTS.element_noises * 2.0, rel=0.1)


def test_without_background_the_noise_is_not_known(background_of):
    length = np.full(SHAPE, 5.0, np.float32)
    least = CONSTANTS.known_share / 2
    few, enough = (background_of(np.full(SHAPE, least + more, np.float32)) for more in (-0.01, 0.01))
    assert noise_level(length, few, CONSTANTS) == 0
    assert noise_level(length, enough, CONSTANTS) == 5
