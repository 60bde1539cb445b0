"""What a frame differs from its reference by although nothing touches: light, exposure, warmth, streaks.

A drift is described by few numbers per channel: low cosines over the frame (LEDs and exposure drift smoothly), a
gain on the reference, and a displacement of the reference's own pattern of light, which wanders as the gel warms and
shears and leaves streaks along the beams' edges. They are fitted by iterated re-weighting (Tukey's biweight), so that
a contact, which follows none of these, does not pull them; a prior on each keeps them from explaining a contact that
covers the whole frame.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.contact import FloatImage, Image
from station.vision.working import capped, length_squared, resized

SPREAD_CAP_LEVELS = 8.0
"""A residual beyond this is no sensor's noise: either a contact or a frame that does not belong to the reference."""

_GRID_LONG_SIDE = 32
_HIGHEST_COSINE = 4
_PRIOR_COSINE_LEVELS = 10.0
_PRIOR_GAIN = 0.1
_PRIOR_DISPLACEMENT_PX = 2.0
_CELL_NOISE_LEVELS = 2.0
_LEAST_SPREAD_LEVELS = 0.5
_ITERATIONS = 5
_LEAST_BACKGROUND = 0.05
_WELL_KNOWN, _LEAST_KNOWN, _KNOWN_POWER = 0.2, 0.05, 3
"""The share of the frame that has to be background for the priors to hold as they are; with less they are drawn in."""
_LATER_SHARE = 0.02
"""What a place counts that the first guess took for contact, once the fit has reached it."""
_TUKEY_WIDTH = 3.0
_PATTERN_SIGMA_PX = 4.0
_STREAK_PRIOR_SHARES, _STREAKS_WELL_KNOWN = (0.03, 0.1), 0.3
"""Of a line's cells: a skirt must not pass for the offset of a line that a large contact leaves little of."""
_STRIP_PX = 10
_NO_PRIOR = 1e-3
_MEDIAN_SIDE = 28


@dataclass(frozen=True, slots=True)
class Drift:
    """The drift found in one frame."""

    levels: FloatImage
    """What to take off the difference, shape (height, width, 3), grey levels."""
    background: FloatImage
    """How surely a place is background, shape (height, width), 0 to 1."""
    spread_levels: float
    """Median length over the channels of what the background still differs by."""
    strength_levels: float
    """Root mean square of the drift over places and channels."""


class DriftModel:
    """The drifts that a reference can undergo, prepared once."""

    def __init__(self, reference: Image) -> None:
        height, width = reference.shape[:2]
        cell = max(height, width) / _GRID_LONG_SIDE
        self._size = (width, height)
        self._grid = (max(2, round(width / cell)), max(2, round(height / cell)))
        self._half = ((width + 1) // 2, (height + 1) // 2)
        self._light = capped(reference)
        pattern = cv2.GaussianBlur(self._light, (0, 0), _PATTERN_SIGMA_PX)
        x = (np.arange(width, dtype=np.float32) + 0.5) / width
        y = (np.arange(height, dtype=np.float32)[:, None] + 0.5) / height
        orders = [
            (i, j)
            for i in range(_HIGHEST_COSINE + 1)
            for j in range(_HIGHEST_COSINE + 1)
            if i * i + j * j <= _HIGHEST_COSINE**2
        ]
        self._orders = np.array(orders).T
        turns = np.pi * np.arange(_HIGHEST_COSINE + 1)
        self._along, self._upward = (
            np.cos(np.outer(turns, (np.arange(n) + 0.5) / n)).astype(np.float32) for n in self._half
        )
        cosines = [np.cos(np.pi * i * x) * np.cos(np.pi * j * y) for i, j in orders]
        stretches = [np.broadcast_to(field, (height, width)) for field in (np.float32(1), 2 * x - 1, 2 * y - 1)]
        slopes = [cv2.Sobel(pattern, cv2.CV_32F, dx, dy, scale=1 / 8) for dx, dy in ((1, 0), (0, 1))]
        grids: list[FloatImage] = []
        for channel in range(3):
            shapes = cosines + [slope[..., channel] * stretch for slope in slopes for stretch in stretches]
            gained = resized(self._light[..., channel], self._grid)
            coarse = [resized(shape, self._grid) for shape in shapes]
            grids.append(np.stack([gained.ravel(), *(c.ravel() for c in coarse)], axis=1).astype(np.float32))
        self._coarse: FloatImage = np.stack(grids)
        self._transposed: FloatImage = np.ascontiguousarray(self._coarse.transpose(0, 2, 1))
        self._slopes = [_rows(resized(np.asarray(slope, np.float32), self._half)) for slope in slopes]
        self._across = np.repeat(np.linspace(-1, 1, self._half[0], dtype=np.float32), 3)
        self._down = np.linspace(-1, 1, self._half[1], dtype=np.float32)[:, None]
        prior = [
            _PRIOR_GAIN,
            *(_PRIOR_COSINE_LEVELS / (1 + i * i + j * j) for i, j in orders),
            *([_PRIOR_DISPLACEMENT_PX] * (len(slopes) * len(stretches))),
        ]
        self._ridge = np.diag((_CELL_NOISE_LEVELS / np.array(prior)) ** 2)

    def fit(self, difference: FloatImage, background: FloatImage) -> Drift:
        """Find the drift in a frame.

        Args:
            difference: frame minus reference, shape (height, width, 3), float32, grey levels.
            background: a first guess of where nothing touches, any size, float32, 0 to 1.
        """
        samples = np.ascontiguousarray(resized(difference, self._grid).reshape(-1, 3).T)
        weight = resized(background, self._grid).ravel()
        trust = _LATER_SHARE + (1 - _LATER_SHARE) * weight
        known = float(np.clip(weight.mean() / _WELL_KNOWN, _LEAST_KNOWN, 1))
        ridge = self._ridge / known**_KNOWN_POWER
        spread = 0.0
        coefficients = np.zeros((3, self._coarse.shape[2], 1), np.float32)
        fitted = np.zeros_like(samples)
        for _ in range(_ITERATIONS):
            weighted = self._transposed * weight
            normal = weighted @ self._coarse + ridge
            coefficients = np.linalg.solve(normal, weighted @ samples[..., None]).astype(np.float32)
            fitted = (self._coarse @ coefficients)[..., 0]
            residual = np.sqrt(((samples - fitted) ** 2).sum(axis=0))
            spread = SPREAD_CAP_LEVELS / 2
            if weight.sum() >= _LEAST_BACKGROUND * weight.size:
                spread = float(np.clip(weighted_median(residual, weight), _LEAST_SPREAD_LEVELS, SPREAD_CAP_LEVELS))
            weight = np.square(np.maximum(0, 1 - np.square(residual / np.float32(_TUKEY_WIDTH * spread)))) * trust
        levels = self._levels(coefficients[..., 0])
        strength = float(np.sqrt(np.mean(fitted**2)))
        certain = np.asarray(weight.reshape(self._grid[1], self._grid[0]), np.float32)
        return Drift(levels, resized(certain, self._size), spread, strength)

    def _levels(self, coefficients: npt.NDArray[np.float32]) -> FloatImage:
        """The drift at the reference's size: its smooth parts drawn at half of it and enlarged, its gain exactly."""
        end = 1 + self._orders.shape[1]
        waves = np.zeros((3, _HIGHEST_COSINE + 1, _HIGHEST_COSINE + 1), np.float32)
        waves[:, self._orders[1], self._orders[0]] = coefficients[:, 1:end]
        lines = self._upward.T @ _rows((waves @ self._along).transpose(1, 2, 0))
        for number, slope in enumerate(self._slopes):
            displaced = coefficients[:, end + 3 * number : end + 3 * number + 3].T
            still, along, up = np.tile(displaced, self._half[0]).astype(np.float32)
            lines += slope * ((still + along * self._across) + up * self._down)
        levels = resized(lines.reshape(self._half[1], self._half[0], 3), self._size)
        _rows(levels)[:] += _rows(self._light) * np.tile(coefficients[:, 0], self._size[0]).astype(np.float32)
        return levels


def _rows(image: FloatImage) -> FloatImage:
    """The image with a row's colours side by side, which numpy goes through much faster; a view."""
    return image.reshape(len(image), -1)


def without_bands(difference: FloatImage) -> FloatImage:
    """The difference with each column's median taken off: good enough to tell a band from a contact.

    Args:
        difference: shape (height, width, 3), grey levels.
    """
    return difference - np.median(difference[:: max(1, len(difference) // _MEDIAN_SIDE)], axis=0)


def without_streaks(change: FloatImage, background: FloatImage) -> FloatImage:
    """Take each column's and then each row's offset over its background off the change, in place.

    An offset is a mean that weights down what departs from it (Tukey's biweight), so that a contact's skirt does not
    pull it; a line of which little is background is corrected by less.

    Args:
        change: shape (height, width, 3), grey levels.
        background: any size, 0 to 1.

    Returns:
        The change.
    """
    height, width = change.shape[:2]
    across, down = max(1, width // _STRIP_PX), max(1, height // _STRIP_PX)
    columns = _offsets(resized(change, (width, down)), resized(background, (width, down)), 0)
    strips = resized(change, (across, height)) - resized(columns, (across, 1))
    rows = _offsets(strips, resized(background, (across, height)), 1)
    lines = _rows(change)
    lines -= columns.reshape(1, -1)
    change -= cv2.resize(rows, (width, height), interpolation=cv2.INTER_NEAREST)
    return change


def _offsets(strips: FloatImage, background: FloatImage, axis: int) -> FloatImage:
    """The lines' offsets along an axis, of length 1 along it."""
    known = max(float(background.mean()) / _STREAKS_WELL_KNOWN, _LEAST_KNOWN)
    prior = strips.shape[axis] * float(np.clip(_STREAK_PRIOR_SHARES[0] / known**_KNOWN_POWER, *_STREAK_PRIOR_SHARES))
    away = length_squared(strips - _line_means(strips, background, axis, _NO_PRIOR))
    limit = _TUKEY_WIDTH**2 * max(weighted_median(away, background), _LEAST_SPREAD_LEVELS**2)
    weight = np.square(np.maximum(0, 1 - away / np.float32(limit))) * background
    return _line_means(strips, weight, axis, prior)


def _line_means(strips: FloatImage, weight: FloatImage, axis: int, prior: float) -> FloatImage:
    weighted = cv2.multiply(strips, cv2.merge([weight] * 3))
    sums = cv2.reduce(weighted, axis, cv2.REDUCE_SUM)
    support = cv2.reduce(weight, axis, cv2.REDUCE_SUM) + np.float32(prior)
    return np.asarray(sums / support[..., None], np.float32)


def thinned(field: FloatImage) -> FloatImage:
    """Every few pixels of a field, about 28 along each side: enough for a median.

    Args:
        field: shape (height, width).
    """
    height, width = field.shape
    return field[:: max(1, height // _MEDIAN_SIDE), :: max(1, width // _MEDIAN_SIDE)]


def weighted_median(values: npt.NDArray[np.floating], weight: npt.NDArray[np.floating]) -> float:
    """The value below which half of the weight lies, 0 where there is no weight; of a field only every few pixels.

    Args:
        values: any shape.
        weight: as many as `values`, not negative.
    """
    if values.ndim == 2:
        values, weight = thinned(values), thinned(weight)
    values = values.ravel()
    order = values.argsort()
    cumulated = weight.ravel()[order].cumsum()
    if cumulated[-1] <= 0:
        return 0.0
    return float(values[order[cumulated.searchsorted(cumulated[-1] / 2)]])
