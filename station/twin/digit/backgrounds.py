"""Images of a DIGIT with nothing touching it, generated with the spread of real units.

A background is a smooth field: its logarithm is a mean plus a few principal variations, all in cosine
coefficients. Dust and fixed column streaks, which no unit lacks, are drawn on top.
"""

import cv2
import numpy as np

from station.twin.digit.numbers import Fitted
from station.twin.gel import SENSOR_SHAPE, FloatArray

COSINES = (16, 12)
"""Coefficients down the rows and along the columns."""
FLOOR = 10.0
"""Grey levels added before the logarithm, so that dark corners do not rule it."""
_WIDEST = 1.6
_STREAKS = 1.0
_DUST = 6


def cosine_basis(length: int, count: int) -> FloatArray:
    """The first `count` cosines of the orthonormal DCT-II at a length in samples.

    Returns:
        Shape (length, count), dtype float32; sampled so that coefficients do not depend on the length.
    """
    place = (np.arange(length) + 0.5) / length
    scale = np.where(np.arange(count) == 0, 1.0, np.sqrt(2.0))
    return (np.cos(np.pi * place[:, None] * np.arange(count)) * scale).astype(np.float32)


def cosine_field(coefficients: FloatArray, shape: tuple[int, int] = SENSOR_SHAPE) -> FloatArray:
    """Draw a field of a shape (rows, columns) from its cosine coefficients, shape (3, rows, columns).

    Returns:
        Shape (*shape, 3), dtype float32.
    """
    down = cosine_basis(shape[0], coefficients.shape[1])
    along = cosine_basis(shape[1], coefficients.shape[2])
    return np.stack([down @ channel @ along.T for channel in coefficients], axis=-1)


def background(fitted: Fitted, unit: int | None) -> FloatArray:
    """The clean no-contact image of a unit, by its seed; None for the unit that the optical table was fitted on.

    Returns:
        Shape (640, 480, 3), dtype float32, grey levels, channels B, G, R.
    """
    # The fitted unit has 0, so that unit 0 has streaks and dust of its own.
    generator = np.random.default_rng([0 if unit is None else unit + 1, 2])
    weights = fitted.background_fitted
    if unit is not None:
        weights = np.clip(generator.standard_normal(weights.size), -_WIDEST, _WIDEST).astype(np.float32)
    coefficients = fitted.background_mean + np.tensordot(weights, fitted.background_modes, axes=1)
    image = np.exp(cosine_field(coefficients.astype(np.float32))) - FLOOR
    streaks = cv2.GaussianBlur(generator.standard_normal((1, SENSOR_SHAPE[1], 3)), (5, 1), 1.0) * _STREAKS
    image = (image + streaks).astype(np.float32)
    _scatter_dust(image, generator)
    return np.clip(image, 0.0, 250.0).astype(np.float32)


def _scatter_dust(image: FloatArray, generator: np.random.Generator) -> None:
    """Darken a few small specks, blurred as by dust under the gel."""
    rows, columns = SENSOR_SHAPE
    shade = np.zeros(SENSOR_SHAPE, np.float32)
    for _ in range(_DUST):
        centre = (int(generator.integers(columns)), int(generator.integers(rows)))
        cv2.circle(shade, centre, int(generator.integers(1, 5)), float(generator.uniform(0.03, 0.15)), cv2.FILLED)
    image *= 1.0 - cv2.GaussianBlur(shade, (0, 0), 2.0)[..., None]
