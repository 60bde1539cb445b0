"""Background model: what changes in the light although nothing touches, and the offsets of rows and columns."""

import numpy as np
import pytest

from station.vision.background import BackgroundModel, destriped, quantile, weighted_median
from station.vision.constants import CONSTANTS
from station.vision.working import resized

SHAPE = (320, 240)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
AWAY = np.hypot(COLUMNS - 120, ROWS - 160)
COLOURS = np.array([1.0, -0.5, 0.7], np.float32)


def reference(seed=0):
    """Light that differs from place to place, with a pattern of its own."""
    spots = sum(
        np.exp(-(np.square(COLUMNS - x) + np.square(ROWS - y)) / 200)
        for x, y in np.random.default_rng(seed).uniform((20, 20), (220, 300), (12, 2))
    )
    return np.stack([80 + 40 * ROWS / 320 + 30 * spots, 100 - 20 * spots, 120 - 50 * COLUMNS / 240], -1).astype(
        np.uint8
    )


MODEL = BackgroundModel(reference(), CONSTANTS)
ALL = np.ones((80, 60), np.float32)


def ball(radius, levels=40.0):
    """Slopes that point outward all around, as in a contact."""
    size = levels * (AWAY / radius) / (1 + np.exp((AWAY / radius - 1) / 0.1)) / np.maximum(AWAY, 1)
    return np.stack([size * (COLUMNS - 120), size * (ROWS - 160), -size * (COLUMNS - 120)], axis=-1)


def band(levels, reach_share=0.07):
    """Light along the lower and the right border, brighter with the load."""
    down, right = (1 - (place + 0.5) / side for place, side in ((ROWS, SHAPE[0]), (COLUMNS, SHAPE[1])))
    return (levels * (np.exp(-down / reach_share) + np.exp(-right / reach_share)))[..., None] * COLOURS


def noise(seed=1):
    return np.random.default_rng(seed).normal(size=(*SHAPE, 3))


def fitted(change, first_guess=ALL, before=None):
    return MODEL.fit((change + noise()).astype(np.float32), first_guess, before)


def left(change, found):
    """Return what the fit leaves of a change, without the noise, at half the working size."""
    return np.abs(halved(change) - found.levels)


def halved(change):
    return resized(np.asarray(change, np.float32), (SHAPE[1] // 2, SHAPE[0] // 2))


@pytest.mark.parametrize(
    "change",
    [
        8 * np.cos(np.pi * COLUMNS / 240)[..., None] * COLOURS,
        0.08 * reference().astype(np.float32),
        band(12.0),
        np.pad(reference(), ((0, 0), (2, 0), (0, 0)), mode="edge")[:, :-2].astype(np.float32) - reference(),
    ],
    ids=["slow light", "gain", "bands along the border", "displaced pattern"],
)
def test_what_light_does_is_background(change):
    found = fitted(change)
    assert found.share > 0.7
    assert np.sqrt(np.mean(np.square(left(change, found)))) < 0.5 * np.sqrt(np.mean(np.square(change)))


def test_of_a_band_nothing_is_left_over_at_the_border():
    change, edge = band(12.0), np.s_[:, -4:]
    share = left(change, fitted(change))[edge].mean() / np.abs(halved(change))[edge].mean()
    assert share < 0.2, "0.003 was measured, and 0.49 with the cosines alone"


def test_a_contact_is_no_background():
    contact = ball(50)
    found = fitted(contact + band(10.0), first_guess=(AWAY[::4, ::4] > 60).astype(np.float32))
    away = AWAY[::2, ::2]
    ring = (away > 25) & (away < 50)
    assert found.weight[ring].mean() < 0.1
    assert found.weight[away > 100].mean() > 0.7
    assert left(band(10.0), found)[ring].mean() < 0.2 * np.abs(halved(contact))[ring].mean()


def test_with_little_background_the_model_explains_less_of_a_contact():
    contact = ball(150)
    sure = (AWAY[::4, ::4] > 185).astype(np.float32)
    assert sure.mean() < CONSTANTS.known_share / 2
    found = fitted(contact, sure)
    ring = (AWAY > 60)[::2, ::2] & (AWAY < 150)[::2, ::2]
    assert np.abs(found.levels)[ring].mean() < 0.3 * np.abs(halved(contact))[ring].mean()


def test_within_a_press_the_model_is_expected_to_have_changed_little():
    bands, contact = band(12.0), ball(150)
    before = fitted(bands)
    hardly = (AWAY[::4, ::4] > 185).astype(np.float32)
    alone, followed = (fitted(bands + contact, hardly, one) for one in (None, before.coefficients))
    beyond = ((AWAY > 150) & ((ROWS > 300) | (COLUMNS > 224)))[::2, ::2]
    assert left(bands, followed)[beyond].mean() < left(bands, alone)[beyond].mean()


def test_a_strong_band_of_light_goes_and_a_contact_in_it_stays():
    contact = ball(30, 20.0)
    banded = (contact + noise(3)).astype(np.float32)
    banded[:, 100:116] += 12
    calm = (AWAY > 76).astype(np.float32)
    clean = destriped(banded.copy(), calm, CONSTANTS)
    assert abs(clean[:60, 100:116].mean()) < 1
    assert np.abs(clean - contact)[AWAY < 30].mean() < 1.5


def test_the_halo_of_a_contact_that_leaves_little_free_is_no_streak():
    halo = np.full((*SHAPE, 3), 12.0, np.float32)
    free = np.zeros(SHAPE, np.float32)
    free[: SHAPE[0] // 12] = 1
    few, many = (destriped(halo.copy(), calm, CONSTANTS)[..., 0].mean() for calm in (free, np.ones(SHAPE, np.float32)))
    assert few > 4
    assert abs(many) < 1


def test_a_weighted_median_is_the_value_below_which_half_of_the_weight_lies():
    values = np.array([3.0, 1.0, 2.0])
    assert weighted_median(values, np.array([1.0, 1.0, 1.0])) == 2
    assert weighted_median(values, np.array([5.0, 1.0, 1.0])) == 3
    assert weighted_median(values, np.zeros(3)) == 0


def test_a_quantile_is_a_value_that_occurs():
    values = np.random.default_rng(2).normal(size=(30, 20))
    assert quantile(values, 0.38) in values
    assert np.mean(values < quantile(values, 0.38)) == pytest.approx(0.38, abs=0.01)
