"""The reference check on units of the twin, and on real units where their images are at hand."""

import cv2
import numpy as np
import pytest

from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import FloatImage
from station.vision.median import median_image
from station.vision.reference_check import ReferenceCheck
from station.vision.working import clipped, resized, working_image
from tests.conftest import SHARED

BACKGROUNDS = SHARED / "data" / "digit_backgrounds"
SAME_UNIT = {"background_01.jpg", "background_02.jpg"}
"""One unit on two days."""


def halved(image: np.ndarray) -> FloatImage:
    work = working_image(np.asarray(image, np.uint8))
    return resized(clipped(work), (work.shape[1] // 2, work.shape[0] // 2))


def sensor_and_check(unit: int | None) -> tuple[DigitSensor, ReferenceCheck]:
    sensor = DigitSensor(1, unit)
    return sensor, ReferenceCheck(halved(median_image([sensor.frame(None, k / 30) for k in range(5)])))


@pytest.fixture(scope="module")
def units() -> list[tuple[DigitSensor, ReferenceCheck]]:
    return [sensor_and_check(unit) for unit in (None, *range(900, 905))]


def compressed(image: np.ndarray, quality: int) -> np.ndarray:
    encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_COLOR), np.uint8)


@pytest.mark.parametrize("closing_mm", [0.0, 0.4, 2.5, 7.0])
@pytest.mark.parametrize("kind", ["strawberry", "blueberry"])
def test_a_press_on_the_same_unit_matches_and_on_another_does_not(units, kind, closing_mm):
    fruit = draw_fruit(kind, 3)
    pressed = FruitOnGel(fruit, Pose(), Gel()).pressed(Squeeze(fruit, Gel()).at(closing_mm))
    same, foreign = [], []
    for own, (sensor, _) in enumerate(units):
        frame = halved(sensor.frame(pressed.dent if closing_mm else None, 8.0))
        for other, (_, check) in enumerate(units):
            (same if other == own else foreign).append(check.mismatch(frame) > 1)
    assert not any(same)
    # The twin's units share a few patterns of light, so some are alike; real ones are not.
    assert np.mean(foreign) >= 0.9


def test_noise_compression_drift_and_a_small_shift_are_no_other_unit(units):
    generator = np.random.default_rng(1)
    for sensor, check in units:
        frame = sensor.frame(None, 3.0)
        height, width = frame.shape[:2]
        slope = np.linspace(-15, 15, width)[None, :, None] * np.array([1.0, -0.7, 0.5])
        drifted = np.clip(frame * np.array([0.9, 1.0, 1.1]) + slope, 0, 255)
        shifted = np.roll(drifted, 2, axis=(0, 1)) + generator.normal(0, 3, drifted.shape)
        for quality in (95, 30):
            image = compressed(np.clip(shifted, 0, 255).astype(np.uint8), quality)
            assert check.mismatch(halved(image)) < 1
            small = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
            assert check.mismatch(halved(small)) < 1


def test_a_pattern_too_weak_to_recognise_is_no_other_unit():
    y, x = np.mgrid[0:1:240j, 0:1:320j]
    smooth = np.stack([90 + 40 * x, 120 - 30 * y, 80 + 20 * x * y], axis=-1)
    generator = np.random.default_rng(2)
    reference, frame = ((smooth + generator.normal(0, 2, smooth.shape)).astype(np.uint8) for _ in range(2))
    assert ReferenceCheck(halved(reference)).mismatch(halved(frame)) < 1


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_another_brightness_is_no_other_unit(units, factor):
    for sensor, check in units:
        brighter = np.clip(sensor.frame(None, 3.0) * factor, 0, 255).astype(np.uint8)
        assert check.mismatch(halved(brighter)) < 1


@pytest.mark.parametrize("fog", [0.2, 0.4])
def test_a_fogged_lens_is_no_other_unit(units, fog):
    # It takes the same share of the pattern everywhere.
    for sensor, check in units:
        assert check.mismatch(halved(sensor.frame(None, 3.0, Condition(fog=fog)))) < 1


def blotches(seed: int, *sigmas_px: float) -> np.ndarray:
    """A random pattern of some sizes, shape (240, 320, 3), each of 12 levels."""
    noise = np.random.default_rng(seed).normal(0, 1, (240, 320, 3)).astype(np.float32)
    sizes = [cv2.GaussianBlur(noise, (0, 0), sigma) for sigma in sigmas_px]
    return np.sum([12 * size / size.std() for size in sizes], axis=0)


def test_another_pattern_is_another_unit_and_a_pattern_on_top_is_not():
    own, other = blotches(4, 6, 12), blotches(5, 6, 12)

    def seen(change):
        return halved((120 + change).astype(np.uint8))

    check = ReferenceCheck(seen(own))
    assert check.mismatch(seen(other)) > 1
    # Two units that share much of their pattern.
    assert check.mismatch(seen(0.8 * own + 0.5 * other)) > 1
    left_half = np.arange(320)[:, None] < 160
    assert check.mismatch(seen(own + other * left_half)) < 1
    assert check.mismatch(seen(own + 2 * blotches(5, 40))) < 1


def test_identical_images_match_exactly():
    image = halved(np.random.default_rng(3).integers(0, 255, (320, 240, 3), dtype=np.uint8))
    assert ReferenceCheck(image).mismatch(image) == pytest.approx(0, abs=1e-5)


@pytest.mark.skipif(not BACKGROUNDS.exists(), reason="the real images are not beside the checkout")
def test_real_units():
    images = {path.name: np.asarray(cv2.imread(str(path)), np.uint8) for path in sorted(BACKGROUNDS.glob("*.jpg"))}
    same, foreign = [], []
    for name, reference in images.items():
        check = ReferenceCheck(halved(reference))
        for other, image in images.items():
            is_same = name == other or {name, other} == SAME_UNIT
            (same if is_same else foreign).append(check.mismatch(halved(compressed(image, 40))) > 1)
    assert not any(same)
    assert all(foreign)
