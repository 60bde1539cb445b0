"""Curvature response: what curves the gel, what does not, and the background's noise in it."""

import numpy as np
import pytest

from station.vision.constants import CONSTANTS
from station.vision.curvature import curvature, curvature_noise, first_background

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
AWAY = np.hypot(COLUMNS - 60, ROWS - 80)
STEP = 2
LEAST = 0.3
COLOURS = np.array([1.0, -0.5, 0.7], np.float32)


def response(change):
    return curvature(np.asarray(change, np.float32), STEP, CONSTANTS)


def bowl(levels):
    """Slopes that grow outward, as under a round body."""
    return levels / 60 * np.stack([COLUMNS - 60, ROWS - 80, 60 - COLUMNS], axis=-1)


def test_it_is_the_slopes_own_slope_in_grey_levels_per_pixel():
    found = response(bowl(60.0))[60:100, 40:80]
    # One level per pixel of the half size along both directions, in colours of both signs: 2·√(2·1) over √2.
    assert found == pytest.approx(np.full_like(found, np.sqrt(2 * np.sqrt(2 * 1)) / STEP), rel=0.05)


def test_a_streak_or_an_even_change_does_not_curve():
    streak = 20 * np.exp(-np.square((COLUMNS - 60) / 4))[..., None] * COLOURS
    inner = np.s_[20:-20, 20:-20]
    assert response(streak)[inner].max() < 0.02
    assert response(np.full((*SHAPE, 3), 30.0))[inner].max() < 1e-3
    assert response(20 * np.exp(-np.square(AWAY / 6))[..., None] * COLOURS).max() > 0.5


def test_calm_is_where_little_curves_and_nothing_encloses_it():
    ring = np.where((AWAY > 25) & (AWAY < 35), 2.0, 0.05).astype(np.float32)
    found = first_background(ring, LEAST, CONSTANTS)
    assert found[AWAY > 40].mean() > 0.9
    assert found[AWAY < 35].max() == 0


def test_an_image_that_curves_nowhere_is_calm_everywhere():
    assert first_background(np.zeros(SHAPE, np.float32), LEAST, CONSTANTS).min() == 1


def test_the_noise_is_the_median_over_the_background_(background_of):
    field = np.where(AWAY < 40, 5.0, 0.1).astype(np.float32)
    assert curvature_noise(field, background_of(AWAY > 45)) == pytest.approx(0.1)
    assert curvature_noise(field, background_of(AWAY < 30)) == pytest.approx(5.0)
    assert curvature_noise(field, background_of(AWAY < 0)) == 0
