"""Light of a loaded gel: bands along the image's border, and a flat gel's shade over its depth.

A gel that is pressed as a whole comes nearer to the LEDs at its sides: bands of one to two millimetres along the
border brighten, each side in its own colours. A flat dent, which has no slope, is seen by its depth alone. Bands of
tens of grey levels were seen on real sensors under soft bodies; the 30 light presses of a ball, against their one
reference, have 1 to 3 at three of the four sides. Every number here is an estimate; the patterns are drawn from the
unit's seed.
"""

import cv2
import numpy as np

from station.twin.gel import GRID_STEP, MM_PER_PX, SENSOR_SHAPE, FloatArray

_COARSE = 4
"""Both patterns are smooth: they are drawn on every fourth pixel."""
_WIDTHS_MM = (0.7, 1.8)
"""Distance from the border at which a band has fallen to 37 %."""
_SIDE_LEDS = {"left": 1, "right": 2, "bottom": 0, "top": None}
"""The channel of the LED at each side, as on the unit that the optics were fitted on; the top has none."""
_OWN_COLOUR, _OTHER_COLOURS = (0.5, 1.0), (-0.1, 0.8)
"""Shares of the brightening in a side's own colour and in the others; the real ball presses show mixed colours."""
_SIDE_STRENGTHS = (0.3, 1.0)
_ALONG_COSINES = 4
_PUSH_MM, _PUSH_POWER = 0.15, 0.7
"""Mean dent at which the bands have come to 63 % of their end, and how early they begin: faint bands come first."""
_SHADES = (-0.6, 1.0)
"""Range of the shade of the three colours, over the strongest possible."""
_SHADE_LEANS = 0.8
"""Largest change of the shade from the image's middle to a side."""


class LoadedLight:
    """Light that a push of the whole gel and the depth of a dent add to the image of one unit.

    Args:
        unit: seed of the unit's light; None for the unit that the optics were fitted on.
    """

    def __init__(self, unit: int | None) -> None:
        generator = np.random.default_rng([0 if unit is None else unit + 1, 8])
        self._bands = _bands(generator)
        self._shade = _shade(generator)

    def bands(self, dent: FloatArray, levels: float) -> FloatArray:
        """The bands' change in grey levels, shape (640, 480, 3).

        Args:
            dent: the gel's dent in mm, shape (320, 240).
            levels: grey levels that the brightest place of the border would gain in the end.
        """
        return self._bands * np.float32(levels * band_share(float(dent.mean())))

    def shade(self, dent: FloatArray, levels_per_mm: float) -> FloatArray:
        """The change in grey levels of a dent by its depth alone, shape (640, 480, 3).

        Args:
            dent: the gel's dent in mm, shape (320, 240).
            levels_per_mm: of the colour that changes most.
        """
        height, width = SENSOR_SHAPE
        depth = np.asarray(cv2.resize(dent, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
        levels = (depth * np.float32(levels_per_mm)).astype(np.float32, copy=False)
        return self._shade * levels[..., None]


def band_share(push_mm: float) -> float:
    """Share of its end, 0 to 1, that a band has come to at a gel's mean dent, mm: it rises at once and bends off."""
    return float(-np.expm1(-((max(0.0, push_mm) / _PUSH_MM) ** _PUSH_POWER)))


def _bands(generator: np.random.Generator) -> FloatArray:
    """The bands at their brightest, the largest value 1; shape (640, 480, 3)."""
    height, width = (side // _COARSE for side in SENSOR_SHAPE)
    total = np.zeros((height, width, 3), np.float32)
    step_mm = _COARSE * MM_PER_PX
    for side, led in _SIDE_LEDS.items():
        across, along = (width, height) if side in {"left", "right"} else (height, width)
        colours = generator.uniform(*_OTHER_COLOURS, 3)
        if led is not None:
            colours[led] = generator.uniform(*_OWN_COLOUR)
        distance_mm = np.arange(across) * step_mm
        profile = np.exp(-np.power(distance_mm / generator.uniform(*_WIDTHS_MM), 1.5))
        place = (np.arange(along) + 0.5) / along
        waves = sum(
            generator.normal(0.0, 0.35 / order) * np.cos(np.pi * order * place) for order in range(1, _ALONG_COSINES)
        )
        course = np.maximum(0.0, 1.0 + waves) * generator.uniform(*_SIDE_STRENGTHS)
        # Each band is made as the left side's, then mirrored and turned to its own.
        band = (course[:, None] * profile)[..., None] * colours
        if side in {"right", "bottom"}:
            band = band[:, ::-1]
        total += band if side in {"left", "right"} else band.transpose(1, 0, 2)
    fine = cv2.resize(total / np.abs(total).max(), SENSOR_SHAPE[::-1], interpolation=cv2.INTER_CUBIC)
    return np.asarray(fine, np.float32)


def _shade(generator: np.random.Generator) -> FloatArray:
    """The shade of a dent of one millimetre over its strongest colour's, tilted over the image; (640, 480, 3)."""
    colours = generator.uniform(*_SHADES, 3)
    colours /= np.abs(colours).max()
    rows, columns = (np.linspace(-1.0, 1.0, side // GRID_STEP, dtype=np.float32) for side in SENSOR_SHAPE)
    lean = generator.uniform(-_SHADE_LEANS, _SHADE_LEANS, (2, 3))
    field = 1.0 + rows[:, None, None] * lean[0] + columns[None, :, None] * lean[1]
    return np.asarray(cv2.resize((field * colours).astype(np.float32), SENSOR_SHAPE[::-1]), np.float32)
