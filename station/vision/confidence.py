"""How far the image supports an area."""

from collections.abc import Sequence

import numpy as np

from station.vision.background import thinned, weighted_median
from station.vision.contact import FloatImage
from station.vision.contour import Edge

_RELIABLE_RATIO = 4.0
_VISIBLE_RATIO = 2.0
_WELL_SEEN = 0.25
LEAST_NOISE_LEVELS = 0.1
_NORMAL_OF_MEDIAN = 1.4826


def background_spread(signal: FloatImage, background: FloatImage) -> float:
    """Standard deviation of the edge signal where nothing touches, from its median absolute deviation.

    Args:
        signal: shape (height, width), grey levels.
        background: shape of `signal`, 0 to 1.
    """
    signal, background = thinned(signal), thinned(background)
    middle = weighted_median(signal, background)
    return _NORMAL_OF_MEDIAN * weighted_median(np.abs(signal - middle), background)


def edge_confidence(edge: Edge, noise_levels: float) -> float:
    """Signal to noise across the edge times the share of the edge that is seen to fall, 0 to 1.

    The first factor is q²/(q² + 4²) of the median drop q in units of the noise; the second is the share of the seen
    rays on which the drop is at least twice the noise. Both rise with the contrast and fall with the noise. Where less
    than a quarter of the rays is seen, it falls with their share.

    Args:
        edge: with its drops in grey levels.
        noise_levels: from `background_spread`.
    """
    if not edge.seen.any():
        return 0.0
    ratio = edge.drop_levels[edge.seen] / max(noise_levels, LEAST_NOISE_LEVELS)
    signal = max(0.0, float(np.median(ratio)))
    support = float(np.mean(ratio >= _VISIBLE_RATIO))
    told = min(1.0, float(np.mean(edge.seen)) / _WELL_SEEN)
    return told * support * signal**2 / (signal**2 + _RELIABLE_RATIO**2)


def agreement(areas: Sequence[float]) -> float:
    """How far several frames of one width step agree, 0 to 1: one over one plus ten times their relative spread.

    Multiply an area's confidence by it. One frame agrees with itself.

    Args:
        areas: of the frames of one step, any unit.

    Raises:
        ValueError: there is none.
    """
    if not areas:
        raise ValueError("no areas to compare: at least one frame is needed")
    middle = float(np.median(areas))
    if middle <= 0:
        return 1.0 if max(areas) <= 0 else 0.0
    return 1.0 / (1.0 + 10.0 * float(np.median(np.abs(np.asarray(areas) - middle))) / middle)
