"""The DIGIT's image of a dented gel, with the sensor's own ills."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import cv2
import numpy as np

from station.twin.digit.backgrounds import background
from station.twin.digit.codec import Image, as_jpeg
from station.twin.digit.debris import dent_of, moved, scattered
from station.twin.digit.loaded import LoadedLight
from station.twin.digit.noise import Drift, FrameNoise
from station.twin.digit.numbers import Fitted
from station.twin.digit.optics import Optics
from station.twin.gel import GRID_STEP, MM_PER_PX, SENSOR_SHAPE, FloatArray

Colour = Literal["blue", "green", "red"]
_CHANNEL: dict[Colour, int] = {"blue": 0, "green": 1, "red": 2}
_DEAD_LED_REST = 0.12
_FOG_BLUR_PX = 12.0
_FULL_LIGHT = (1.0, 1.0, 1.0)
_GAIN_LIMITS = (0.5, 1.6)
_STRIP_ROWS = 64
"""Rows that are summed at a time, which stay in the processor's cache: by whole images a sum takes a fifth longer."""
_WORN_LOSS = 0.6
"""Of the light's change, where the coating is worn through."""


@dataclass(frozen=True, slots=True)
class Condition:
    """Defects of the sensor and its images; none by default."""

    dead_led: Colour | None = None
    torn: bool = False
    """A tear across the gel: a bright line with a dark lip, and the dents around it half lost."""
    fog: float = 0.0
    """0 clear to 1: the image blurs towards a grey veil."""
    dirt: int = 0
    """Number of particles on the gel: they dent it all the time."""
    wear: float = 0.0
    """0 new to 1 worn through: the coating reflects less of the light that a dent turns, most in the middle."""
    light: tuple[float, float, float] = _FULL_LIGHT
    """Brightness of the LEDs, blue, green and red, over that of the fit."""
    dirt_moved: int = 0
    """0 for debris that stays; any other number is the seed of its new places: some specks moved, lost or new."""
    bands: float = 0.0
    """Grey levels that the image's border gains in the end as the whole gel is pushed towards its LEDs."""
    depth_shade: float = 0.0
    """Grey levels that a flat dent changes for each mm of its depth."""
    jpeg_quality: int = 0
    """1 to 100: each frame is compressed and decoded again; 0 for frames as the sensor sends them."""


class DigitSensor:
    """Draws frames. The clean image is reused until dent, condition or drift change; noise is new in each frame.

    Args:
        seed: of the noise and the drift; the same calls give the same frames.
        unit: seed of the unit's light; None for the unit that the optics were fitted on.
        noise: factor on the noise of each frame; 0 for none.
        drift: factor on the slow drift; 0 for none.
        mm_per_px: the gel's, which the dents are drawn at.
    """

    def __init__(
        self,
        seed: int,
        unit: int | None = None,
        noise: float = 1.0,
        drift: float = 1.0,
        mm_per_px: float = MM_PER_PX,
    ) -> None:
        fitted, self._optics = _fitted(), _optics(mm_per_px)
        self._background = background(fitted, unit)
        levels = np.divide(cv2.mean(self._background)[:3], _fitted_levels())
        self._gain = np.clip(levels, *_GAIN_LIMITS).astype(np.float32)
        self._noise, self._noise_factor = FrameNoise(fitted.noise, seed), noise
        self._drift, self._drift_factor = Drift(fitted.noise, seed), drift
        self._seed, self._unit = seed, unit
        self._loaded: LoadedLight | None = None
        self._dent: FloatArray | None = None
        self._condition = Condition()
        # Kept from frame to frame: fresh memory of this size costs as much as the sums.
        self._lined, self._spread = (np.empty((_STRIP_ROWS, SENSOR_SHAPE[1], 3), np.float32) for _ in range(2))
        self._clean = self._draw(None, self._condition)
        self._base = self._drifted()

    def frame(self, dent: FloatArray | None, now_s: float, condition: Condition | None = None) -> Image:
        """Draw one frame.

        Args:
            dent: the gel's dent in mm, shape (320, 240); None where nothing touches. Hand over the same
                array as long as nothing moves: the clean image is then drawn once.
            now_s: the twin's time; it moves the drift.
            condition: what is wrong with the sensor; nothing where left out.

        Returns:
            Shape (640, 480, 3), dtype uint8, channels B, G, R.
        """
        condition = condition or Condition()
        redraw = dent is not self._dent or condition != self._condition
        if redraw:
            self._dent, self._condition = dent, condition
            self._clean = self._draw(dent, condition)
        # Advanced first: behind `redraw or` the drift would not advance while the fingers close.
        if self._drift.advance(now_s) or redraw:
            self._base = self._drifted()
        image = self._noisy()
        return as_jpeg(image, condition.jpeg_quality) if condition.jpeg_quality else image

    def _noisy(self) -> Image:
        if not self._noise_factor:
            # convertScaleAbs rounds and saturates, but makes negative values positive.
            return np.asarray(cv2.convertScaleAbs(np.maximum(self._base, 0.0)), np.uint8)
        factor = np.float32(self._noise_factor)
        columns, rows = self._noise.columns() * factor, self._noise.rows() * factor
        pixels, image = self._noise.pixels(), np.empty((*SENSOR_SHAPE, 3), np.uint8)
        lined, spread = self._lined, self._spread
        for top in range(0, SENSOR_SHAPE[0], _STRIP_ROWS):
            strip = slice(top, top + _STRIP_ROWS)
            np.add(self._base[strip], columns, out=lined)
            # Spread by OpenCV: numpy's broadcasting along pixels of three channels takes five times as long.
            cv2.resize(rows[strip], spread.shape[1::-1], dst=spread, interpolation=cv2.INTER_NEAREST)
            cv2.add(lined, spread, dst=lined)
            cv2.addWeighted(pixels[strip], float(factor), lined, 1.0, 0.0, dst=image[strip], dtype=cv2.CV_8U)
        return image

    def _drifted(self) -> FloatArray:
        return np.asarray(cv2.scaleAdd(self._drift.field, self._drift_factor, self._clean), np.float32)

    def _draw(self, dent: FloatArray | None, condition: Condition) -> FloatArray:
        # Made anew for each drawing, so that debris and tear stay in their places.
        generator = np.random.default_rng([self._seed, 5])
        pressed = dent  # without the debris, which is there in the reference too
        if condition.dirt:
            specks = scattered(condition.dirt, generator)
            if condition.dirt_moved:
                specks = moved(specks, np.random.default_rng([self._seed, 9, condition.dirt_moved]))
            debris = dent_of(specks)
            dent = debris if dent is None else np.maximum(dent, debris)
        image = self._background.copy()
        if dent is not None:
            change = self._optics.change(dent, self._gain)
            image += change * _worn(condition.wear) if condition.wear else change
        if pressed is not None:
            self._load(image, pressed, condition)
        if condition.torn:
            _tear(image, self._background, generator)
        if condition.light != _FULL_LIGHT:
            image *= np.asarray(condition.light, np.float32)
        if condition.dead_led:
            image[..., _CHANNEL[condition.dead_led]] *= _DEAD_LED_REST
        # The lens is last in the light's way: its fog blurs all that was drawn before.
        if condition.fog:
            blurred = cv2.GaussianBlur(image, (0, 0), _FOG_BLUR_PX * condition.fog)
            image = blurred * (1.0 - 0.7 * condition.fog) + blurred.mean() * 0.7 * condition.fog
        return image.astype(np.float32, copy=False)

    def _load(self, image: FloatArray, dent: FloatArray, condition: Condition) -> None:
        """Add the light of a loaded gel to an image."""
        if not (condition.bands or condition.depth_shade):
            return
        if self._loaded is None:
            self._loaded = LoadedLight(self._unit)
        if condition.bands:
            image += self._loaded.bands(dent, condition.bands)
        if condition.depth_shade:
            image += self._loaded.shade(dent, condition.depth_shade)


# What all sensors have in common is made once: tests and benchmarks make hundreds of them in one process.
@cache
def _fitted() -> Fitted:
    return Fitted.load()


@cache
def _optics(mm_per_px: float) -> Optics:
    return Optics(_fitted().table, _fitted().smoothing_mm, mm_per_px * GRID_STEP)


@cache
def _fitted_levels() -> tuple[float, ...]:
    """Mean grey level of each channel of the unit that the optics were fitted on, no contact."""
    return tuple(cv2.mean(background(_fitted(), None))[:3])


def _worn(wear: float) -> FloatArray:
    """Return the share of the light's change that a worn coating leaves, shape (640, 480, 1)."""
    rows, columns = (np.linspace(-1.0, 1.0, side, dtype=np.float32) for side in SENSOR_SHAPE)
    from_middle = np.square(rows)[:, None] + np.square(columns)
    return (1.0 - np.float32(_WORN_LOSS * wear) * np.exp(-from_middle / 2)).astype(np.float32)[..., None]


def _tear(image: FloatArray, background_image: FloatArray, generator: np.random.Generator) -> None:
    """Draw a jagged tear from one side to the other into an image."""
    rows, columns = SENSOR_SHAPE
    x = np.linspace(0, columns - 1, 9)
    y = rows * generator.uniform(0.3, 0.7) + np.cumsum(generator.normal(0, 25, x.size))
    path = np.stack([x, y], axis=1).astype(np.int32)
    near, line = np.zeros(SENSOR_SHAPE, np.float32), np.zeros(SENSOR_SHAPE, np.float32)
    cv2.polylines(near, [path], isClosed=False, color=1.0, thickness=60)
    cv2.polylines(line, [path], isClosed=False, color=1.0, thickness=5)
    lost = cv2.GaussianBlur(near, (0, 0), 15.0)[..., None] * 0.5
    image += (background_image - image) * lost
    sharp = cv2.GaussianBlur(line, (0, 0), 1.5)
    lip = np.roll(sharp, 5, axis=0)
    image += (sharp * 110.0 - lip * 60.0)[..., None]
