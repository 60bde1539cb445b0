"""Noise between two frames of the same scene: pixel noise, streaks, row and frame offsets, slow drift of light.

Levels are measured on real frames (`benchmarks.twin.fit`). The real pixel noise is blotchy (colour is sampled
at half the resolution and compressed): neighbours correlate as after a Gaussian blur of the widths below, and
the channels as given. Pixel noise is cut from a bank of fields made once, at random places, since drawing nearly
a million normal deviates per frame would cost more than all the rest.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from station.twin.digit.backgrounds import cosine_field
from station.twin.digit.numbers import NoiseLevels
from station.twin.gel import SENSOR_SHAPE, FloatArray

_BANKS = 6
_BANK_MARGIN = 48
_BLUR_ACROSS_PX, _BLUR_DOWN_PX = 1.25, 1.75
_CHANNELS = np.array([[1.0, -0.29, 0.11], [-0.29, 1.0, -0.27], [0.11, -0.27, 1.0]])
_LINE_BLUR_PX = 1.6
_DRIFT_SHAPE = (80, 60)
_DRIFT_DOWN, _DRIFT_ALONG = 6, 24
"""Cosines of the drift; along the columns the real change falls off slowly, as bands beside each other."""
_BURSTS = 0.75
"""Spread of the logarithm of the drift's steps; gives the real offsets' ratio of 95th percentile to median."""
DRIFT_TIME_S = 10.0
"""The drift forgets itself in this time: real frames change from the reference 1.3 times as much as from the last."""
DRIFT_STEP_S = 0.2
"""The drift's field is drawn anew when this much time has passed."""


@lru_cache(maxsize=1)  # of the sensor made last: who makes it again, as tests and benchmarks do, waits for no draw
def _banks(levels: tuple[float, ...], seed: int) -> tuple[list[FloatArray], Mapping[str, Any]]:
    """Fields of pixel noise, and the state of the generator that has drawn them."""
    generator = np.random.default_rng([seed, 3])
    rows, columns = (side + _BANK_MARGIN for side in SENSOR_SHAPE)
    mix = np.linalg.cholesky(_CHANNELS)
    banks: list[FloatArray] = []
    for _ in range(_BANKS):
        # By OpenCV: numpy takes four times as long for sums and products along pixels of three channels.
        white = cv2.transform(generator.standard_normal((rows, columns, 3), np.float32), mix)
        field = cv2.GaussianBlur(white, (0, 0), _BLUR_ACROSS_PX, sigmaY=_BLUR_DOWN_PX)
        # The blur lowers the spread: each field is scaled from the spread that it has to the level.
        spread = cv2.meanStdDev(field)[1].ravel()
        banks.append(np.asarray(cv2.transform(field, np.diag(np.divide(levels, spread))), np.float32))
    return banks, generator.bit_generator.state


class FrameNoise:
    """Everything that is new in each frame."""

    def __init__(self, levels: NoiseLevels, seed: int) -> None:
        self._levels = levels
        self._banks, state = _banks(tuple(map(float, levels.pixel)), seed)
        self._generator = np.random.default_rng()
        # Continues after the banks' draws, so that a sensor made from the cache draws the same frames.
        self._generator.bit_generator.state = state

    def pixels(self) -> FloatArray:
        """Pixel noise, shape (640, 480, 3), dtype float32; a view that must not be changed."""
        bank = self._banks[self._generator.integers(_BANKS)]
        top, left = self._generator.integers(_BANK_MARGIN + 1, size=2)
        return bank[top : top + SENSOR_SHAPE[0], left : left + SENSOR_SHAPE[1]]

    def columns(self) -> FloatArray:
        """Column streaks, shape (1, 480, 3)."""
        return self._line(SENSOR_SHAPE[1], self._levels.column)[None]

    def rows(self) -> FloatArray:
        """Row offsets, shape (640, 1, 3)."""
        return self._line(SENSOR_SHAPE[0], self._levels.row)[:, None]

    def _line(self, length: int, level: FloatArray) -> FloatArray:
        white = self._generator.standard_normal((1, length, 3), np.float32)
        # To OpenCV a sigmaY of 0 would mean sigmaX.
        line = cv2.GaussianBlur(white, (0, 0), _LINE_BLUR_PX, sigmaY=1e-3, borderType=cv2.BORDER_REFLECT)[0]
        # A Gaussian blur of width s leaves white noise a variance of 1 / (2·√π·s); the factor restores it to 1.
        return (line * (level * np.float32(np.sqrt(2.0 * np.sqrt(np.pi) * _LINE_BLUR_PX)))).astype(np.float32)


class Drift:
    """Slow change of exposure and of the light's pattern: a decaying random walk with now and then a large step."""

    def __init__(self, levels: NoiseLevels, seed: int) -> None:
        self._generator = np.random.default_rng([seed, 4])
        # The first row of coefficients is what the columns' means see, the first column what the rows' see.
        along = levels.drift_along[:, None] * _falling(_DRIFT_ALONG, -0.5)
        down = levels.drift_down[:, None] * _falling(_DRIFT_DOWN, -1.0)
        self._scale = np.zeros((3, _DRIFT_DOWN, _DRIFT_ALONG), np.float32)
        self._scale[:, 0, 0] = levels.offset
        self._scale[:, 0, 1:], self._scale[:, 1:, 0] = along, down
        self._scale[:, 1:, 1:] = np.sqrt(down[:, :, None] * along[:, None, :]) * (_falling(_DRIFT_ALONG, -2.0) / 2.0)
        # Begins with its full spread, so that the first frames drift as later ones do.
        self._state = self._innovation()
        self._at_s: float | None = None
        self.field = self._draw()

    def advance(self, now_s: float) -> bool:
        """Go on to the twin's time; whether the field has been drawn anew."""
        if self._at_s is None:
            self._at_s = now_s
        passed_s = now_s - self._at_s
        if passed_s < DRIFT_STEP_S:
            return False
        kept = np.exp(-passed_s / DRIFT_TIME_S)
        # The two squared factors add up to 1: the variance stays the same however long the step.
        self._state = kept * self._state + np.sqrt(1.0 - kept**2) * self._innovation()
        self._at_s = now_s
        self.field = self._draw()
        return True

    def _innovation(self) -> FloatArray:
        """Normal deviates whose common size varies: now and then all of the light changes at once."""
        # Log-normal with a mean square of 1: bursts change the distribution and not the level.
        size = np.exp(_BURSTS * self._generator.standard_normal() - _BURSTS**2)
        return (self._generator.standard_normal(self._scale.shape) * size * self._scale).astype(np.float32)

    def _draw(self) -> FloatArray:
        height, width = SENSOR_SHAPE
        # The shortest wave has five of the coarse points, enough to interpolate between them.
        coarse = cosine_field(self._state.astype(np.float32), _DRIFT_SHAPE)
        return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _falling(count: int, power: float) -> FloatArray:
    """Amplitudes of the cosines above the constant one, the sum of their squares 1."""
    amplitudes = np.arange(1, count) ** power
    return (amplitudes / np.sqrt(np.square(amplitudes).sum())).astype(np.float32)
