"""The skirt of gel that a body draws down around its contact, and whether it explains what lies around an outline."""

import cv2
import numpy as np

from station.vision.contact import FloatImage, Mask
from station.vision.edge import Edge

_RATIOS = np.array([1.6, 2.0, 2.5, 3.0, 3.6])
_SKIRT = (2 * _RATIOS * np.arcsin(1 / _RATIOS) - 2 * np.sqrt(_RATIOS**2 - 1) / _RATIOS) / np.pi
"""Slope of a half-space outside a paraboloid's contact over that at its edge, by the distance in contact radii:
the derivative of Johnson's equation 3.42a (Contact Mechanics, 1985)."""
_STRONG_QUANTILE = 0.75
_FEWEST = 8
_ROOM = 1.8


def unexplained(length: FloatImage, region: Mask, edge: Edge, inside: Mask, noise_levels: float) -> float:
    """The change around an outline over what the skirt of such a contact would show there.

    Less than 1 around most bodies' own outlines; more around a seed's, whose surroundings are pressed in as well. It is
    0 where the border cuts the outline, since half of the skirt is then not seen, and where the region hardly
    reaches beyond it.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: where the change stands out of the noise, shape of `length`, 0 or not.
        edge: the outline.
        inside: the outline filled, shape of `length`, 0 or not.
        noise_levels: the length where nothing touches.
    """
    if not edge.seen.all() or np.count_nonzero(region) < _ROOM**2 * np.count_nonzero(inside):
        return 0.0
    middle = edge.points.mean(axis=0)
    around = (middle + (edge.points - middle) * _RATIOS[:, None, None]).astype(np.float32)
    x, y = np.ascontiguousarray(around[..., 0]), np.ascontiguousarray(around[..., 1])
    seen = cv2.remap(region, x, y, cv2.INTER_NEAREST, None, cv2.BORDER_CONSTANT) > 0
    if np.count_nonzero(seen) < _FEWEST or not inside.any():
        return 0.0
    levels = cv2.remap(length, x, y, cv2.INTER_LINEAR) - noise_levels
    strong = float(np.quantile(length[inside > 0], _STRONG_QUANTILE)) - noise_levels
    expected = strong * float((_SKIRT[:, None] * seen).sum())
    return float(levels[seen].sum()) / expected if expected > 0 else 0.0
