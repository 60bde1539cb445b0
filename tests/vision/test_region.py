"""The region of one body in synthetic changes."""

import cv2
import numpy as np
import pytest

from station.vision.constants import CONSTANTS
from station.vision.curvature import curvature
from station.vision.region import find_region, flat_field_correction, level_of, movement

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def away(x=60.0, y=80.0):
    return np.hypot(COLUMNS - x, ROWS - y)


@pytest.fixture
def moved(background_of):
    """Return a function that prepares a noisy change with a given contact for the search for regions."""

    def make(change, seed=0, noise_levels=1.0):
        noisy = (change + np.random.default_rng(seed).normal(0, noise_levels, (*SHAPE, 3))).astype(np.float32)
        background = background_of((np.abs(change).sum(axis=2) < 0.5).astype(np.float32))
        return movement(noisy, background, np.ones(SHAPE, np.float32), curvature(noisy, 2, CONSTANTS))

    return make


def region(moved, start, **more):
    found = find_region(moved, start, CONSTANTS, **more)
    assert found is not None
    return found


def smooth(radius, levels=12.0):
    """Slopes that point outward all around, as a ball's do, with a flat centre."""
    x, y, r = COLUMNS - 60.0, ROWS - 80.0, away()
    size = levels * (r <= radius) * np.clip(r / radius - 0.3, 0, None) / np.maximum(r, 1)
    return np.stack([size * x, size * y, 0 * x], axis=-1)


def textured(inside, levels=12.0, seed=1):
    """Slopes that turn from place to place, within a radius or a mask."""
    generator = np.random.default_rng(seed)
    blocks = generator.normal(0, levels, (SHAPE[0] // 4, SHAPE[1] // 4, 3)).repeat(4, axis=0).repeat(4, axis=1)
    return blocks * (away() <= inside if np.isscalar(inside) else inside)[..., None]


def bar(half_width, angle_deg=25.0):
    """A stem or cylinder that crosses the field, 0 or 1."""
    mask = np.zeros(SHAPE, np.uint8)
    along = 200 * np.array([np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg))])
    x, y = (int(place) for place in along)
    return np.asarray(cv2.line(mask, (60 - x, 80 - y), (60 + x, 80 + y), 1, thickness=2 * half_width + 1), np.uint8)


def start(radius, x=60.0, y=80.0):
    return (away(x, y) <= radius).astype(np.uint8)


@pytest.mark.parametrize("made", [smooth, textured])
@pytest.mark.parametrize("seen_px", [20, 45])
def test_the_region_of_a_body_does_not_depend_on_where_it_was_seen(moved, made, seen_px):
    mask = region(moved(made(32)), start(seen_px)).mask
    assert 0.9 < np.count_nonzero(mask) / (np.pi * 32**2) < 1.35


def test_directions_that_turn_from_place_to_place_are_texture(moved):
    regions = [region(moved(change), start(32)) for change in (smooth(32), textured(32))]
    assert [one.textured for one in regions] == [False, True]


def test_slopes_that_agree_by_half_are_measured_once_more_and_are_texture(moved):
    found = region(moved(smooth(32) + textured(32, levels=3.0)), start(32))
    assert 0.4 < found.coherence < 0.7
    assert found.textured


def test_texture_that_is_known_from_an_earlier_step_is_taken_over(moved):
    assert region(moved(smooth(32)), start(32), texture=True).textured
    assert not region(moved(textured(32)), start(32), texture=False).textured


def test_without_background_what_is_finer_than_the_slopes_of_the_body_is_texture(moved):
    slopes = 0.5 * np.stack([COLUMNS - 59.5, ROWS - 79.5, 0.0 * ROWS], axis=-1)
    regions = [region(moved(change), start(45)) for change in (slopes, slopes + textured(200, levels=22.0))]
    assert [one.textured for one in regions] == [False, True]


def test_an_open_ring_is_its_whole_disc(moved):
    ring = smooth(40) * ((away() > 26) & ((ROWS > 60) | (np.abs(COLUMNS - 60) > 10)))[..., None]
    mask = region(moved(ring), (np.abs(ring).sum(axis=2) > 1).astype(np.uint8)).mask
    assert 0.9 < np.count_nonzero(mask) / (np.pi * 40**2) < 1.35
    assert mask[80, 60]


@pytest.mark.parametrize("angle_deg", [0, 25, 90])
@pytest.mark.parametrize("half_width", [8, 14])
def test_a_long_body_across_the_field_is_one_region(moved, half_width, angle_deg):
    truth = bar(half_width, angle_deg)
    mask = region(moved(textured(truth > 0)), truth & (away() < 60)).mask
    assert np.count_nonzero(mask & truth) > 0.85 * np.count_nonzero(truth)
    assert np.count_nonzero(mask) < 1.5 * np.count_nonzero(truth)


def test_a_region_may_reach_beyond_the_border(moved):
    found = region(moved(textured(200)), start(45))
    assert found.mask.mean() > 0.97
    assert found.radii.max() > 60


def test_what_belongs_to_others_is_left_to_them(moved):
    both = textured(14) + np.roll(textured(14, seed=2), 34, axis=0)
    alone = region(moved(both), start(14), others=start(16, y=114.0))
    assert not (alone.mask & (away(y=114.0) < 12)).any()


def test_what_has_been_in_contact_before_is_in_the_region_though_it_moves_no_more(moved):
    change = textured((away() > 22) & (away() <= 34))
    floor = start(30)
    without, followed = (region(moved(change), start(12, x=88.0), floor=one).mask for one in (None, floor))
    assert np.count_nonzero(followed & floor) > 0.97 * np.count_nonzero(floor)
    assert np.count_nonzero(without & floor) < np.count_nonzero(followed & floor)


def test_nothing_stands_out_of_noise_alone(moved):
    still = moved(np.zeros((*SHAPE, 3)))
    level = level_of(still, 3.0)
    assert np.median(level.levels) < 2 * level.spread(still)


def test_weak_light_is_corrected():
    light = np.full((*SHAPE, 3), 100.0, np.float32)
    light[:, :60] = 20.0
    factors = flat_field_correction(light, CONSTANTS)
    assert factors[80, 10] > 2 * factors[80, 110]
    assert factors.mean() == pytest.approx(1.2, abs=0.3)
