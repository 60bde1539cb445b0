"""How far the image supports an area."""

import numpy as np

from station.vision.edge import Edge

_RELIABLE_RATIO = 4.0
_VISIBLE_RATIO = 2.0


def edge_confidence(edge: Edge, noise_levels: float) -> float:
    """Signal to noise across the edge times the share of the edge that is seen to fall, 0 to 1.

    The first factor is q²/(q² + 4²) of the median drop q in units of the noise; the second is the share of the seen
    rays on which the drop is at least twice the noise. Both rise with the contrast and fall with the noise.

    Args:
        edge: with its drops in grey levels.
        noise_levels: the change's length where nothing touches, median, grey levels.
    """
    if not edge.seen.any():
        return 0.0
    ratio = edge.drop_levels[edge.seen] / max(noise_levels, 0.1)
    signal = max(0.0, float(np.median(ratio)))
    support = float(np.mean(ratio >= _VISIBLE_RATIO))
    return support * signal**2 / (signal**2 + _RELIABLE_RATIO**2)
