"""The numbers fitted on real images, which `python -m benchmarks.twin.fit` writes into `fitted.npz`."""

from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from station.twin.gel import FloatArray

FILE = "fitted.npz"


@dataclass(frozen=True, slots=True)
class NoiseLevels:
    """Standard deviations in grey levels of one frame, each of shape (3,), channels B, G, R."""

    pixel: FloatArray
    column: FloatArray
    row: FloatArray
    offset: FloatArray
    """Of the whole frame by the slow drift of the light."""
    drift_along: FloatArray
    """Of the columns' means by the same drift."""
    drift_down: FloatArray
    """Of the rows' means by the same drift."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """All that the twin's DIGIT has learned from real images."""

    table: FloatArray
    """Grey levels, shape (knots, directions, places, 3): see `station.twin.digit.optics`."""
    smoothing_mm: float
    background_mean: FloatArray
    """Cosine coefficients of the logarithm of a no-contact image, shape (3, rows, columns)."""
    background_modes: FloatArray
    """Its principal variations from unit to unit, one standard deviation each, shape (modes, 3, rows, columns)."""
    background_fitted: FloatArray
    """The coefficients of the unit that the table was fitted on, shape (modes,)."""
    noise: NoiseLevels

    @classmethod
    def load(cls) -> "Fitted":
        """Read the committed file."""
        with files("station.twin.digit").joinpath(FILE).open("rb") as file, np.load(file) as archive:
            # The background's coefficients are stored as float16, which is too coarse to compute with.
            numbers: dict[str, Any] = {name: archive[name].astype(np.float32) for name in archive.files}
        noise = NoiseLevels(**{name: numbers.pop(f"noise_{name}") for name in NoiseLevels.__dataclass_fields__})
        return cls(**dict[str, Any]({**numbers, "smoothing_mm": float(numbers["smoothing_mm"]), "noise": noise}))
