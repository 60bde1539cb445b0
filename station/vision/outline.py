"""The outline of one contact: along a smooth body's edge, or the union of what textured skin presses in."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.vision import texture
from station.vision.confidence import background_spread, edge_confidence
from station.vision.contact import FloatImage, Mask
from station.vision.contour import COSINES, RAYS, SINES, Edge, find_edge
from station.vision.region import Body

_SUBPIXEL_BITS = 4
_WITHIN, _BEYOND = 0.8, 1.2
_SURELY_SMOOTH, _CLEAR_NOISES = 0.62, 15.0


@dataclass(frozen=True, slots=True)
class Outline:
    """One contact's outline at the working size."""

    edge: Edge
    inside: Mask
    """What the edge encloses, or of textured skin the union of its elements there; 0 or 255."""
    textured: bool
    confidence: float

    def drawn(self, height: int, width: int) -> Mask:
        """The contact at another size, shape (height, width), 0 or 255."""
        if not self.textured:
            return filled(self.edge, (height, width), (width / self.inside.shape[1], height / self.inside.shape[0]))
        grown = cv2.resize(self.inside, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(cv2.threshold(grown, 127, 255, cv2.THRESH_BINARY)[1], np.uint8)


def find_outline(length: FloatImage, body: Body, background: FloatImage, stiffness: float) -> Outline:
    """Find the outline of the contact in a body's region.

    Args:
        length: of the denoised change, shape (height, width), grey levels.
        body: found at half that size.
        background: how surely a place is background, shape of `length`, 0 to 1.
        stiffness: as for `find_edge`.
    """
    height, width = length.shape
    region = np.asarray(cv2.resize(body.region, (width, height), interpolation=cv2.INTER_NEAREST), np.uint8)
    scale = width / body.region.shape[1], height / body.region.shape[0]
    middle = ((body.middle[0] + 0.5) * scale[0] - 0.5, (body.middle[1] + 0.5) * scale[1] - 0.5)
    noise = texture.noise_of(length, background) if texture.has_room_for_few(region) else 0.0
    if not body.textured and not _is_faint_skin(length, region, body, noise):
        edge = find_edge(length, region, middle, stiffness)
        confidence = edge_confidence(edge, background_spread(length, background))
        return Outline(edge, filled(edge, (height, width)), textured=False, confidence=confidence)
    points = np.stack([COSINES, SINES], axis=1) * body.radii_px[:, None] * scale + middle
    seen = (points >= 0).all(axis=1) & (points[:, 0] <= width - 1) & (points[:, 1] <= height - 1)
    edge = Edge(points, seen, _fall(body))
    inside, sure = texture.union(length, region, texture.level(length, region, body, noise), noise)
    return Outline(edge, inside, textured=True, confidence=sure * edge_confidence(edge, body.spread_levels))


def _is_faint_skin(length: FloatImage, region: Mask, body: Body, noise: float) -> bool:
    """Whether a body that passes for smooth stands so little out of the noise that the edge found may be a seed's.

    Not where directions agree as they hardly do on skin. Where the noise is not known, directions tell little.
    """
    return body.coherence < _SURELY_SMOOTH and texture.strength(length, region) < _CLEAR_NOISES * noise


def filled(edge: Edge, shape: tuple[int, int], scale: tuple[float, float] = (1.0, 1.0)) -> Mask:
    """What an edge encloses.

    Args:
        edge: in pixels of the working size.
        shape: height and width of the mask.
        scale: of the mask over the working size, along x and y.

    Returns:
        Of that shape, 0 or 255.
    """
    points = (edge.points + 0.5) * scale - 0.5
    mask = np.zeros(shape, np.uint8)
    fixed = np.rint(points * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(mask, [fixed], 255, cv2.LINE_8, _SUBPIXEL_BITS)
    return mask


def _fall(body: Body) -> npt.NDArray[np.float64]:
    """By how much a body's level falls across the end of its region, on each ray, grey levels."""
    away = body.radii_px[:, None] * np.array([_WITHIN, _BEYOND])
    x, y = body.middle[0] + COSINES[:, None] * away, body.middle[1] + SINES[:, None] * away
    levels = cv2.remap(
        body.level, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE
    )
    return (levels[:, 0] - levels[:, 1]).astype(np.float64).reshape(RAYS)
