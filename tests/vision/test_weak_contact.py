"""Weak-contact detector: what noise, drift, dents, dead LEDs and places at an end of the scale give."""

import cv2
import numpy as np
import pytest

from station.vision.constants import CONSTANTS
from station.vision.weak_contact import WeakContactDetector

SHAPE = (160, 120)
GATE_RATIO = 3.0
COLOURS = np.array([[1.0, -0.3, 0.1], [-0.3, 1.0, -0.3], [0.1, -0.3, 1.0]])
PLACE = (70, 90)


def reference(level=100.0):
    return np.full((*SHAPE, 3), level, np.float32)


def detector(level=100.0, lit=(True, True, True), clean=None, gate_ratio=GATE_RATIO):
    clean = np.ones(SHAPE, np.float32) if clean is None else clean
    return WeakContactDetector(reference(level), np.array(lit), clean, CONSTANTS, gate_ratio)


def noise(generator, levels=(1.0, 1.0, 1.0), blur_px=0.5):
    white = generator.standard_normal((*SHAPE, 3)) @ np.linalg.cholesky(COLOURS).T
    field = cv2.GaussianBlur(white, (0, 0), blur_px)
    return (field / field.std(axis=(0, 1)) * levels).astype(np.float32)


def drift(generator, levels):
    """Bands along the columns that fall off slowly down them."""
    down = (np.arange(SHAPE[0]) + 0.5) / SHAPE[0]
    slow = np.cos(np.pi * down[:, None] * np.arange(6))
    return np.einsum("yk,kxc->yxc", slow, levels * generator.standard_normal((6, SHAPE[1], 3))).astype(np.float32)


def dent(levels, place=PLACE, sigma_px=3.0):
    """Return the change of a small round dent: each colour is the slope along its own light."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    x, y = (x - place[0]) / sigma_px, (y - place[1]) / sigma_px
    depth = np.exp((1 - x * x - y * y) / 2)
    lights = np.deg2rad([0, 120, 240])
    slopes = [depth * (x * np.cos(one) + y * np.sin(one)) for one in lights]
    return (levels * np.stack(slopes, axis=2)).astype(np.float32)


@pytest.mark.parametrize("levels", [(1.0, 1.0, 1.0), (0.2, 3.0, 1.0)])
def test_noise_follows_the_chi_distribution_whatever_its_levels_and_common_parts(levels):
    weak = detector()
    responses = [weak.response(reference() + noise(np.random.default_rng(seed), levels)) for seed in range(6)]
    inner = [response.field[12:-12, 12:-12] for response in responses]
    assert np.mean(np.square(inner)) == pytest.approx(6.0, rel=0.16)
    assert all(weak.place(response) is None for response in responses)


@pytest.mark.parametrize("seed", range(4))
def test_a_faint_dent_is_found_under_drift_that_hides_it(seed):
    generator = np.random.default_rng(seed)
    frame = reference() + noise(generator) + drift(generator, levels=8.0)
    weak = detector()
    assert weak.place(weak.response(frame)) is None
    place = weak.place(weak.response(frame + dent(levels=2.5)))
    assert place == pytest.approx(PLACE, abs=3)


@pytest.mark.parametrize(("gain", "moved_px"), [(1.1, 0.0), (1.0, 0.4), (0.93, -0.3)])
def test_a_pattern_of_light_that_gains_or_moves_does_not_hide_or_feign_a_touch(gain, moved_px):
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    spots = ((25, 30), (90, 40), (30, 130), (95, 125))
    spot = sum(np.exp(-(np.square(x - left) + np.square(y - top)) / 50) for left, top in spots)
    pattern = np.stack([100 + 60 * spot, 100 - 40 * spot, 100 + 30 * spot], axis=2).astype(np.float32)
    shift = np.array([[1, 0, moved_px], [0, 1, moved_px]], np.float32)
    moved = gain * cv2.warpAffine(pattern, shift, SHAPE[::-1], borderMode=cv2.BORDER_REPLICATE)
    weak = WeakContactDetector(pattern, np.ones(3, bool), np.ones(SHAPE, np.float32), CONSTANTS, GATE_RATIO)
    frame = moved + noise(np.random.default_rng(5))
    assert weak.place(weak.response(frame)) is None
    assert weak.place(weak.response(frame + dent(levels=2.5))) == pytest.approx(PLACE, abs=3)


def test_noise_that_the_colours_have_in_common_does_not_hide_a_touch():
    generator = np.random.default_rng(6)
    flicker = cv2.GaussianBlur(generator.standard_normal(SHAPE), (0, 0), 0.0001)[..., None]
    frame = reference() + noise(generator, (0.3, 0.3, 0.3)) + (3 * flicker / flicker.std()).astype(np.float32)
    weak = detector()
    assert weak.place(weak.response(frame)) is None
    assert weak.place(weak.response(frame + dent(levels=2.5))) == pytest.approx(PLACE, abs=3)


def test_a_higher_gate_ratio_needs_a_stronger_touch():
    weak, strict = detector(), detector(gate_ratio=2 * GATE_RATIO)
    response = weak.response(reference() + noise(np.random.default_rng(0)) + dent(levels=2.5))
    assert weak.place(response) is not None
    assert strict.place(response) is None


def test_a_lower_gate_ratio_does_not_let_noise_through():
    assert detector(gate_ratio=GATE_RATIO / 2).threshold == detector().threshold == CONSTANTS.weak_threshold


def test_the_surroundings_of_a_place_end_at_the_border():
    weak = detector()
    whole, corner = (np.zeros(SHAPE)[weak.near(place)].shape for place in ((60, 80), (0, 159)))
    assert whole[0] == whole[1]
    assert corner == ((whole[0] + 1) // 2,) * 2


def test_a_colour_without_light_adds_nothing():
    weak = detector(lit=(True, True, False))
    flicker = dent(levels=40.0) * np.array([0, 0, 1], np.float32)
    response = weak.response(reference() + noise(np.random.default_rng(1)) + flicker)
    assert weak.place(response) is None


@pytest.mark.parametrize("level", [3.0, 250.0])
def test_a_reference_at_an_end_of_the_scale_decides_nothing(level):
    weak = detector(level)
    response = weak.response(reference(level) + noise(np.random.default_rng(2)) + dent(levels=20.0))
    assert response.field.max() == 0
    region = np.zeros(SHAPE, np.uint8)
    region[80:100, 60:80] = 1
    assert weak.supports(region, response)


def test_nothing_is_found_where_debris_lies():
    clean = np.ones(SHAPE, np.float32)
    clean[PLACE[1] - 2 : PLACE[1] + 3, PLACE[0] - 2 : PLACE[0] + 3] = 0
    weak = detector(clean=clean)
    assert weak.response(reference() + dent(levels=20.0)).field[PLACE[1], PLACE[0]] == 0


def test_a_region_is_supported_where_the_gel_is_dented_and_not_where_light_drifts():
    generator = np.random.default_rng(3)
    weak = detector()
    response = weak.response(reference() + noise(generator) + drift(generator, levels=8.0) + dent(levels=2.0))
    for x, supported in ((PLACE[0], True), (PLACE[0] - 45, False)):
        region = np.zeros(SHAPE, np.uint8)
        cv2.circle(region, (x, PLACE[1]), 8, 1, cv2.FILLED)
        assert weak.supports(region, response) == supported


def test_a_codecs_blocks_are_no_contact():
    weak = detector()
    light = noise(np.random.default_rng(0), (3.0, 3.0, 3.0)) + reference()
    generator, shape = np.random.default_rng(1), (SHAPE[0] // 4, SHAPE[1] // 4, 3)
    blocks = generator.normal(0, 0.2, shape) + 3 * (generator.random(shape) < 0.01)
    coded = reference() + blocks.repeat(4, axis=0).repeat(4, axis=1).astype(np.float32)
    assert weak.response(light).compression == 1
    response = weak.response(coded)
    assert response.compression > 1
    assert response.field.max() > weak.threshold
    assert weak.place(response) is None
