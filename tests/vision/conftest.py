"""Golden contacts: spheres pressed into a gel whose colours follow its slope, drawn in numpy alone."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from station.vision.background import Background

LIGHTS = np.array([[-0.2, 1.0], [-0.9, -0.4], [1.0, -0.5]])
"""What a slope of one along x and along y changes in B, G and R."""


def fall(relative: np.ndarray) -> np.ndarray:
    """The slope's size: rising as a sphere's, falling beyond the edge as real presses' means over rays do."""
    return relative / (1 + np.exp((relative - 1) / 0.12))


AXIS = np.linspace(0, 2, 2001)
STEEPEST = AXIS[np.argmin(np.gradient(fall(AXIS)))]
"""Where that falls most steeply, which is the contact's edge."""


class Press(NamedTuple):
    reference: np.ndarray
    image: np.ndarray
    truth: np.ndarray


def background(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    return np.stack([70 + 40 * y, 90 + 50 * x, 120 - 50 * x * y], axis=-1)


def noisy(light: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """As measured on real frames: pixels, column streaks, row offsets."""
    height, width = light.shape[:2]
    pixels = generator.normal(size=light.shape) * (3.1, 1.8, 2.5)
    columns = generator.normal(size=(1, width, 3)) * (1.8, 1.3, 2.6)
    rows = generator.normal(size=(height, 1, 3))
    return np.clip(np.rint(light + pixels + columns + rows), 0, 255).astype(np.uint8)


def sphere_change(
    shape: tuple[int, int], x_px: float, y_px: float, radius_px: float, levels: float
) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[: shape[0], : shape[1]]
    away = np.hypot(x - x_px, y - y_px)
    steepness = fall(away / radius_px * STEEPEST)
    direction = np.stack([x - x_px, y - y_px]) / np.maximum(away, 1e-6)
    change = levels * np.einsum("cd,dhw->hwc", LIGHTS, direction * steepness)
    return change, away <= radius_px


@pytest.fixture(scope="session")
def sphere_press() -> Callable[..., Press]:
    def make(
        x_px: float = 240.0,
        y_px: float = 320.0,
        radius_px: float = 70.0,
        *,
        levels: float = 40.0,
        shape: tuple[int, int] = (640, 480),
        seed: int = 1,
    ) -> Press:
        generator = np.random.default_rng(seed)
        light = background(*shape)
        change, truth = sphere_change(shape, x_px, y_px, radius_px, levels)
        return Press(noisy(light, generator), noisy(light + change, generator), truth)

    return make


@pytest.fixture(scope="session")
def overlap() -> Callable[[np.ndarray, np.ndarray], float]:
    def iou(mask: np.ndarray, truth: np.ndarray) -> float:
        found = mask > 0
        return float(np.count_nonzero(found & truth) / max(1, np.count_nonzero(found | truth)))

    return iou


@pytest.fixture(scope="session")
def noisy_again() -> Callable[[np.ndarray, int], np.ndarray]:
    """Another frame of the same scene: noise, an offset per channel and a slow drift of the light."""

    def make(image: np.ndarray, seed: int) -> np.ndarray:
        generator = np.random.default_rng(seed)
        x = np.linspace(0, np.pi, image.shape[1])[None, :, None]
        y = np.linspace(0, np.pi, image.shape[0])[:, None, None]
        slow = generator.normal(size=3) * np.cos(x) + generator.normal(size=3) * np.cos(y)
        return noisy(image + generator.normal(size=3) * 1.5 + 2 * slow, generator)

    return make


@pytest.fixture(scope="session")
def background_of() -> Callable[[np.ndarray], Background]:
    """A background that takes nothing off, of a weight for each place."""

    def make(weight: np.ndarray) -> Background:
        levels = np.zeros((*weight.shape, 3), np.float32)
        coefficients = np.zeros((3, 1, 1), np.float32)
        return Background(levels, np.asarray(weight, np.float32), float(weight.mean()), 1.0, 0.0, coefficients)

    return make
