"""Background model: what a frame differs from its reference by although nothing touches the gel.

Per colour the model is a sum of low cosines over the frame (LEDs and exposure drift smoothly), bands along the four
borders (the gel as a whole is pushed towards its LEDs), a gain on the reference, and a displacement of the reference's
own pattern of light. It is fitted by iterated re-weighting with Tukey's biweight (P. J. Huber, Robust Statistics,
section 7.8), so that a contact, which follows none of these shapes, does not pull it. A normal prior on each
coefficient prevents the model from explaining a contact; within a press the prior's mean is the last step's model.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.constants import Constants
from station.vision.contact import FloatImage, Image
from station.vision.working import NEXT_TO_NOTHING, clipped, length_squared, resized

_GRID_LONG_SIDE = 32
"""Cells along the long side on which the model is fitted. Resolution: its highest cosine has 16 of them a period."""
_HIGHEST_COSINE = 4
"""Half periods over the frame. At 3 the fit's cost is 0.01 higher; higher ones follow a contact."""
_ITERATIONS = 3
"""Of the re-weighting. Resolution: with 2 the fit's cost is 0.01 higher."""
_LEAST_KNOWN = 0.05
"""Of `known_share`, below which the priors are drawn in no further; of the frame, below which no spread is measured."""
LEAST_BACKGROUND = 0.02
"""Share of the frame below which nothing is counted in the background, since there is hardly any."""
_TUKEY_WIDTH = 3.0
"""In median residuals, beyond which a cell has no weight. At 4.685, the usual width, the fit's cost is 0.006 higher."""
_LEAST_SPREAD_LEVELS = 0.5
"""What the rounding of pixels to whole levels can hide; real sensors' noise is more."""
_STRIP_PX = 5
"""At half the working size."""
_MEDIAN_SIDE = 20
"""Samples at least along each side for a median. Resolution: 400 of them give it to 6 % of the spread."""
_FREE = 10.0
"""So wide a prior only keeps the equations solvable, where a reference has no light."""

Coefficients = npt.NDArray[np.float32]
"""A fitted model, shape (3, shapes, 1), dtype float32, one row for each colour."""


@dataclass(frozen=True, slots=True)
class Background:
    """The background found in one frame."""

    levels: FloatImage
    """What to take off the difference, shape (height, width, 3) of half the working size, grey levels."""
    weight: FloatImage
    """How surely a place is background, shape (height, width) of half the working size, 0 to 1."""
    share: float
    """Mean of the weight: how much of the frame is background, 0 to 1. The one measure of that for every stage."""
    spread_levels: float
    """Median length over the channels of what the background still differs by."""
    strength_levels: float
    """Root mean square of the model over places and channels."""
    coefficients: Coefficients
    """For the press's next step."""


class BackgroundModel:
    """The changes of light that a reference can undergo, prepared once.

    Args:
        reference: at the working size, shape (height, width, 3), dtype uint8.
        constants: priors and weights.
    """

    def __init__(self, reference: Image, constants: Constants) -> None:
        self._constants = constants
        height, width = reference.shape[:2]
        cell = max(height, width) / _GRID_LONG_SIDE
        self._grid = (max(2, round(width / cell)), max(2, round(height / cell)))
        self._half = (-(-width // 2), -(-height // 2))
        light = clipped(reference)
        self._light = resized(light, self._half)
        pattern = cv2.GaussianBlur(light, (0, 0), constants.pattern_blur)
        # Cosines and bands are products of a function of x and one of y: each is drawn as two short matrices.
        orders = [
            (i, j)
            for i in range(_HIGHEST_COSINE + 1)
            for j in range(_HIGHEST_COSINE + 1)
            if i * i + j * j <= _HIGHEST_COSINE**2
        ]
        count = _HIGHEST_COSINE + 1
        # The functions after the cosines are a band at either end.
        places = [*orders, (count, 0), (count + 1, 0), (0, count), (0, count + 1)]
        self._places = np.array(places).T
        along, upward = (_profiles(side, constants.band_reach) for side in (width, height))
        self._along, self._upward = (_profiles(side, constants.band_reach) for side in self._half)
        separable = [np.outer(upward[j], along[i]) for i, j in places]
        x, y = np.linspace(-1, 1, width, dtype=np.float32), np.linspace(-1, 1, height, dtype=np.float32)[:, None]
        stretches = [np.broadcast_to(one, (height, width)) for one in (np.float32(1), x, y)]
        slopes = [cv2.Sobel(pattern, cv2.CV_32F, dx, dy, scale=1 / 8) for dx, dy in ((1, 0), (0, 1))]
        shared = [resized(shape, self._grid).ravel() for shape in separable]
        grids: list[FloatImage] = []
        for channel in range(3):
            gained = resized(light[..., channel], self._grid).ravel()
            moved = [
                resized(slope[..., channel] * stretch, self._grid).ravel() for slope in slopes for stretch in stretches
            ]
            grids.append(np.stack([gained, *shared, *moved], axis=1).astype(np.float32))
        self._coarse: FloatImage = np.stack(grids)
        self._transposed: FloatImage = np.ascontiguousarray(self._coarse.transpose(0, 2, 1))
        self._slopes = [_rows(resized(np.asarray(slope, np.float32), self._half)) for slope in slopes]
        self._across = np.repeat(np.linspace(-1, 1, self._half[0], dtype=np.float32), 3)
        self._down = np.linspace(-1, 1, self._half[1], dtype=np.float32)[:, None]
        prior = [
            _FREE,  # the gain: a contact resembles no gain of the whole light
            *(constants.light_prior / (1 + i * i + j * j) for i, j in orders),
            *([constants.light_prior] * (len(places) - len(orders))),
            *([constants.displacement_prior] * (len(slopes) * len(stretches))),
        ]
        self._ridge = np.diag(np.array(prior) ** -2.0).astype(np.float32)

    def fit(self, difference: FloatImage, first_guess: FloatImage, before: Coefficients | None = None) -> Background:
        """Find the background of a frame.

        Args:
            difference: frame minus reference, any size, shape (height, width, 3), float32, grey levels.
            first_guess: where nothing touches, any size, float32, 0 to 1.
            before: the press's last step; the model is then expected to have changed little.
        """
        p = self._constants
        samples = np.ascontiguousarray(resized(difference, self._grid).reshape(-1, 3).T)
        expected = np.zeros((3, self._coarse.shape[2], 1), np.float32) if before is None else before
        # The fit is of what has changed since the expected model, so that the prior draws towards that model.
        expected_levels = (self._coarse @ expected)[..., 0]
        samples -= expected_levels
        trust = weight = resized(first_guess, self._grid).ravel()
        # The less background there is, the more of a contact's own slopes the shapes could explain.
        known = min(max(float(weight.mean()) / p.known_share, _LEAST_KNOWN), 1.0)
        ridge = self._ridge / known**3
        spread = p.most_spread / 2
        change = np.zeros_like(expected)
        fitted = np.zeros_like(samples)
        for _ in range(_ITERATIONS):
            weighted = self._transposed * weight
            change = np.linalg.solve(weighted @ self._coarse + ridge, weighted @ samples[..., None]).astype(np.float32)
            fitted = (self._coarse @ change)[..., 0]
            residual = np.sqrt(((samples - fitted) ** 2).sum(axis=0))
            if weight.sum() >= _LEAST_KNOWN * weight.size:
                spread = min(max(weighted_median(residual, weight), _LEAST_SPREAD_LEVELS), p.most_spread)
            weight = np.square(np.maximum(0, 1 - np.square(residual / np.float32(_TUKEY_WIDTH * spread)))) * trust
        coefficients = expected + change
        strength = float(np.sqrt(np.mean((fitted + expected_levels) ** 2)))
        certain = resized(np.asarray(weight.reshape(self._grid[1], self._grid[0]), np.float32), self._half)
        share = float(weight.mean())
        return Background(self._drawn(coefficients[..., 0]), certain, share, spread, strength, coefficients)

    def _drawn(self, coefficients: npt.NDArray[np.float32]) -> FloatImage:
        """The model at half the working size."""
        end = 1 + self._places.shape[1]
        waves = np.zeros((3, len(self._upward), len(self._along)), np.float32)
        waves[:, self._places[1], self._places[0]] = coefficients[:, 1:end]
        lines = self._upward.T @ _rows((waves @ self._along).transpose(1, 2, 0))
        gain, *displaced = np.tile(coefficients[:, [0, *range(end, coefficients.shape[1])]].T, self._half[0])
        part = np.empty_like(lines)
        for number, slope in enumerate(self._slopes):
            still, along, up = displaced[3 * number : 3 * number + 3]
            np.multiply(up, self._down, out=part)
            part += still + along * self._across
            part *= slope
            lines += part
        lines += np.multiply(_rows(self._light), gain, out=part)
        return lines.reshape(self._half[1], self._half[0], 3)


def _profiles(length: int, band_reach: float) -> npt.NDArray[np.float32]:
    """Cosines from the constant one on, then a band at the beginning and one at the end, shape (7, length)."""
    place = (np.arange(length) + 0.5) / length
    cosines = np.cos(np.outer(np.pi * np.arange(_HIGHEST_COSINE + 1), place))
    return np.concatenate([cosines, np.exp(-np.stack([place, 1 - place]) / band_reach)]).astype(np.float32)


def _rows(image: FloatImage) -> FloatImage:
    """The image with a row's colours side by side, which numpy goes through much faster; a view."""
    return image.reshape(len(image), -1)


def destriped(change: FloatImage, background: FloatImage, constants: Constants) -> FloatImage:
    """Take each column's and then each row's offset over its background off the change, in place.

    An offset is a mean that weights down what departs from it (Tukey's biweight), so that a contact's halo does not
    pull it; a line of which little is background is corrected by less.

    Args:
        change: at half the working size, shape (height, width, 3), grey levels.
        background: any size, 0 to 1.
        constants: the prior of an offset.

    Returns:
        The change.
    """
    height, width = change.shape[:2]
    across, down = max(1, width // _STRIP_PX), max(1, height // _STRIP_PX)
    columns = _offsets(resized(change, (width, down)), resized(background, (width, down)), 0, constants)
    strips = resized(change, (across, height)) - resized(columns, (across, 1))
    rows = _offsets(strips, resized(background, (across, height)), 1, constants)
    lines = _rows(change)
    lines -= columns.reshape(1, -1)
    change -= cv2.resize(rows, (width, height), interpolation=cv2.INTER_NEAREST)
    return change


def _offsets(strips: FloatImage, background: FloatImage, axis: int, constants: Constants) -> FloatImage:
    """The lines' offsets along an axis, of length 1 along it."""
    # The less background, the less a line's mean is believed: with the same prior everywhere, a blueberry that fills
    # the field is wrong by half.
    known = min(max(float(background.mean()) / constants.known_share, _LEAST_KNOWN), 1)
    prior = strips.shape[axis] * min(constants.stripe_prior / known**2, 0.1)
    away = length_squared(strips - _line_means(strips, background, axis, NEXT_TO_NOTHING))
    limit = _TUKEY_WIDTH**2 * max(weighted_median(away, background), _LEAST_SPREAD_LEVELS**2)
    weight = np.square(np.maximum(0, 1 - away / np.float32(limit))) * background
    return _line_means(strips, weight, axis, prior)


def _line_means(strips: FloatImage, weight: FloatImage, axis: int, prior: float) -> FloatImage:
    weighted = cv2.multiply(strips, cv2.merge([weight] * 3))
    sums = cv2.reduce(weighted, axis, cv2.REDUCE_SUM)
    support = cv2.reduce(weight, axis, cv2.REDUCE_SUM) + np.float32(prior)
    return np.asarray(sums / support[..., None], np.float32)


def thinned(field: FloatImage) -> FloatImage:
    """Every few pixels of a field, shape (height, width): 20 to 39 along a side with as many, enough for a median."""
    height, width = field.shape
    return field[:: max(1, height // _MEDIAN_SIDE), :: max(1, width // _MEDIAN_SIDE)]


def weighted_median(values: npt.NDArray[np.floating], weight: npt.NDArray[np.floating]) -> float:
    """The value below which half of the weight lies, 0 where there is no weight; of a field only every few pixels.

    The values have any shape; there are as many weights, none of them negative.
    """
    if values.ndim == 2:
        values, weight = thinned(values), thinned(weight)
    values = values.ravel()
    order = values.argsort()
    cumulated = weight.ravel()[order].cumsum()
    if cumulated[-1] <= 0:
        return 0.0
    return float(values[order[cumulated.searchsorted(cumulated[-1] / 2)]])


def quantile(values: npt.NDArray[np.floating], share: float) -> float:
    """The largest of the values below which at most a share, 0 to 1, of the others lies; any shape, not empty."""
    return quantiles(values, share)[0]


def quantiles(values: npt.NDArray[np.floating], *shares: float) -> list[float]:
    """Several quantiles, as `quantile`, in one pass."""
    values = values.ravel()
    places = [int(share * (values.size - 1)) for share in shares]
    return [float(one) for one in np.partition(values, places)[places]]
