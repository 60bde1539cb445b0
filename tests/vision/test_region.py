"""Where a body lies: regions of synthetic changes."""

import numpy as np
import pytest

from station.vision.curvature import bending
from station.vision.region import evening, find_body, has_moved_widely, level_of, movement

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def away(x=60.0, y=80.0):
    return np.hypot(COLUMNS - x, ROWS - y)


def moved(change, seed=0, noise_levels=1.0):
    noisy = (change + np.random.default_rng(seed).normal(0, noise_levels, (*SHAPE, 3))).astype(np.float32)
    background = (np.abs(change).sum(axis=2) < 0.5).astype(np.float32)
    return movement(noisy, background, np.ones(SHAPE, np.float32), bending(noisy, 2))


def smooth(radius, levels=12.0):
    """Slopes that point outward all around, as a ball's do, with a flat centre."""
    x, y, r = COLUMNS - 60.0, ROWS - 80.0, away()
    size = levels * (r <= radius) * np.clip(r / radius - 0.3, 0, None) / np.maximum(r, 1)
    return np.stack([size * x, size * y, 0 * x], axis=-1)


def textured(radius, levels=12.0, seed=1):
    """Slopes that turn from place to place."""
    generator = np.random.default_rng(seed)
    blocks = generator.normal(0, levels, (SHAPE[0] // 4, SHAPE[1] // 4, 3)).repeat(4, axis=0).repeat(4, axis=1)
    return blocks * (away() <= radius)[..., None]


def start(radius, x=60.0, y=80.0):
    return (away(x, y) <= radius).astype(np.uint8)


@pytest.mark.parametrize("made", [smooth, textured])
@pytest.mark.parametrize("seen_px", [20, 45])
def test_the_region_of_a_body_does_not_hang_on_where_it_was_seen(made, seen_px):
    body = find_body(moved(made(32)), start(seen_px))
    assert body is not None
    assert 0.9 < np.count_nonzero(body.region) / (np.pi * 32**2) < 1.35


def test_directions_that_turn_from_place_to_place_are_texture():
    bodies = [find_body(moved(change), start(32)) for change in (smooth(32), textured(32))]
    assert [body is not None and body.textured for body in bodies] == [False, True]


def test_without_background_what_is_finer_than_the_body_s_slopes_is_texture():
    slopes = 0.5 * np.stack([COLUMNS - 59.5, ROWS - 79.5, 0.0 * ROWS], axis=-1)
    bodies = [find_body(moved(change), start(45)) for change in (slopes, slopes + textured(200, levels=22.0))]
    assert [body is not None and body.textured for body in bodies] == [False, True]


def test_without_background_skin_ends_where_the_gel_stops_bending():
    skirt = 0.3 * np.stack([COLUMNS - 59.5, ROWS - 79.5, 0.0 * ROWS], axis=-1)
    body = find_body(moved(skirt + textured(58, levels=30.0)), start(70))
    assert body is not None
    assert body.textured
    assert 0.8 < np.count_nonzero(body.region) / (np.pi * 58**2) < 1.4


def test_a_wide_movement_is_neither_noise_nor_a_small_contact():
    changes = (np.zeros((*SHAPE, 3)), textured(25), smooth(70, levels=25.0))
    assert [has_moved_widely(moved(change)) for change in changes] == [False, False, True]


def test_an_open_ring_is_its_whole_disc():
    ring = smooth(40) * ((away() > 26) & ((ROWS > 60) | (np.abs(COLUMNS - 60) > 10)))[..., None]
    body = find_body(moved(ring), (np.abs(ring).sum(axis=2) > 1).astype(np.uint8))
    assert body is not None
    assert 0.9 < np.count_nonzero(body.region) / (np.pi * 40**2) < 1.35
    assert body.region[80, 60]


def test_a_region_may_reach_beyond_the_border():
    body = find_body(moved(textured(200)), start(45))
    assert body is not None
    assert body.region.mean() > 0.97
    assert body.radii_px.max() > 60


def test_what_belongs_to_others_is_left_to_them():
    both = textured(14) + np.roll(textured(14, seed=2), 34, axis=0)
    other = start(16, y=114.0)
    alone = find_body(moved(both), start(14), other)
    assert alone is not None
    assert not (alone.region & (away(y=114.0) < 12)).any()


def test_nothing_stands_out_of_noise_alone():
    level, spread = level_of(moved(np.zeros((*SHAPE, 3))), 3.0)
    assert np.median(level) < 2 * spread


def test_weak_light_is_made_up_for():
    light = np.full((*SHAPE, 3), 100.0, np.float32)
    light[:, :60] = 20.0
    factors = evening(light)
    assert factors[80, 10] > 2 * factors[80, 110]
    assert factors.mean() == pytest.approx(1.2, abs=0.3)
