"""Confidence: how far the image supports an area."""

import statistics
from collections.abc import Sequence

import numpy as np

from station.vision.background import thinned, weighted_median
from station.vision.constants import NORMAL_OF_MEDIAN, Constants
from station.vision.contact import FloatImage
from station.vision.contour import Edge

_LEAST_NOISE_LEVELS = 0.1
"""No sensor's noise is less; it only keeps an image without noise from dividing by 0."""
_PER_SPREAD = 10.0
"""An agreement is one half where the frames' areas spread by a tenth."""


def background_spread(signal: FloatImage, background: FloatImage) -> float:
    """Standard deviation of the edge signal where nothing touches, from its median absolute deviation.

    Args:
        signal: shape (height, width), grey levels.
        background: shape of `signal`, 0 to 1.
    """
    signal, background = thinned(signal), thinned(background)
    middle = weighted_median(signal, background)
    return NORMAL_OF_MEDIAN * weighted_median(np.abs(signal - middle), background)


def edge_confidence(edge: Edge, noise_levels: float, constants: Constants) -> float:
    """Signal to noise (`background_spread`) across the edge times the share of it that is seen to fall, 0 to 1.

    The first factor is q²/(q² + 4²) of the median drop q in units of the noise; the second is the share of the seen
    rays on which the change falls at all.
    """
    if not edge.seen.any():
        return 0.0
    ratios = (edge.drop_levels[edge.seen] / max(noise_levels, _LEAST_NOISE_LEVELS)).tolist()
    signal = max(0.0, statistics.median(ratios))
    support = sum(ratio > 0 for ratio in ratios) / len(ratios)
    return support * signal**2 / (signal**2 + constants.reliable_ratio**2)


def agreement(areas: Sequence[float]) -> float:
    """Return the agreement of the areas, any unit, of one step's frames, 0 to 1: 1 / (1 + 10 * relative spread).

    Multiply an area's confidence by it. One frame agrees with itself.

    Raises:
        ValueError: there is none.
    """
    if not areas:
        raise ValueError("no areas to compare: at least one frame is needed")
    middle = float(np.median(areas))
    if middle <= 0:
        return 1.0 if max(areas) <= 0 else 0.0
    return 1.0 / (1.0 + _PER_SPREAD * float(np.median(np.abs(np.asarray(areas) - middle))) / middle)
