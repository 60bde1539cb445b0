"""The outline of one contact: along the edge of a smooth body, of textured skin, or around few drupelets."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from station.vision import elements
from station.vision.confidence import LEAST_NOISE_LEVELS, background_spread, edge_confidence
from station.vision.contact import FloatImage, Mask
from station.vision.drift import weighted_median
from station.vision.edge import Edge, find_edge
from station.vision.edge_signal import element_px, envelope, is_textured
from station.vision.skirt import unexplained

_UNEXPLAINED = 0.8
_LARGEST_ELEMENT_SHARE = 0.03
"""Of the frame: 7 mm² of a DIGIT's field, more than a seed's or a drupelet's outline ever has."""
_FIRST_CAP, _SECOND_CAP = 0.4, 0.25
_CORE_SHARE, _AROUND_SHARE = 0.85, 1.25
_SUBPIXEL_BITS = 4


class Place(NamedTuple):
    """Where an outline is looked for; all of one shape (height, width)."""

    region: Mask
    """Where the gel bends, 0 or not."""
    widen: Callable[[], Mask] | None
    """Gives the region with the changed places around it; None where each region is a contact of its own."""
    middle: tuple[float, float]
    """x and y from which the contact is star-shaped, px."""
    background: FloatImage
    """How surely a place is background, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Outline:
    """One contact's outline at the working size."""

    edge: Edge
    inside: Mask
    """What the edge encloses, or of few elements their union; 0 or 255."""
    apart: bool
    """Whether it is such a union."""
    confidence: float

    def drawn(self, height: int, width: int) -> Mask:
        """The contact at another size, shape (height, width), 0 or 255."""
        if not self.apart:
            return filled(self.edge, (height, width), (width / self.inside.shape[1], height / self.inside.shape[0]))
        grown = cv2.resize(self.inside, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.where(grown > 127, 255, 0).astype(np.uint8)


def find_outline(length: FloatImage, bend: FloatImage, place: Place, stiffness: float) -> Outline:
    """Find the outline of the contact in a region.

    A smooth body's is the edge of the change's length. Where the region is textured, or where the outline is a
    seed's by its size and its surroundings, it is the edge of the length's envelope; of few elements their union.

    Args:
        length: of the denoised change, shape (height, width), grey levels.
        bend: half that size, grey levels per pixel.
        place: where to look.
        stiffness: as for `find_edge`.
    """
    region, shape = place.region, (length.shape[0], length.shape[1])
    element = element_px(length, bend, region)
    signal, doubt = length, 1.0
    edge = None if is_textured(element, radius_px(region)) else find_edge(length, region, place.middle, stiffness)
    if edge is not None and place.widen is not None:
        inside = filled(edge, shape)
        if np.count_nonzero(inside) < _LARGEST_ELEMENT_SHARE * inside.size:
            wide = place.widen()
            doubt = unexplained(length, wide, edge, inside, weighted_median(length, place.background))
            if doubt > _UNEXPLAINED:
                edge, region = None, wide
    textured = edge is None
    if edge is None:
        signal = envelope(length, region, _FIRST_CAP, element)
        edge = find_edge(signal, region, place.middle, stiffness)
        core = filled(_scaled(edge, _CORE_SHARE), shape)
        if core.any():
            signal = envelope(length, core, _SECOND_CAP, element)
            edge = find_edge(signal, filled(edge, shape), _centre(edge, shape), stiffness)
    inside = filled(edge, shape)
    confidence = edge_confidence(edge, background_spread(signal, place.background)) / max(1.0, doubt)
    if textured and inside.any():
        level = elements.level(length, inside, element)
        noise = weighted_median(length, place.background), background_spread(length, place.background)
        if elements.show_apart(inside, element, (level - noise[0]) / max(noise[1], LEAST_NOISE_LEVELS)):
            around = filled(_scaled(edge, _AROUND_SHARE), shape)
            return Outline(edge, elements.union(length, around, level), apart=True, confidence=confidence)
    return Outline(edge, inside, apart=False, confidence=confidence)


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


def radius_px(region: Mask) -> float:
    """Of a circle of the region's area.

    Args:
        region: 0 or not.
    """
    return float(np.sqrt(np.count_nonzero(region) / np.pi))


def _centre(edge: Edge, shape: tuple[int, int]) -> tuple[float, float]:
    """The middle of an edge's points, x and y, inside the image."""
    x, y = np.clip(edge.points.mean(axis=0), 0, (shape[1] - 1, shape[0] - 1))
    return float(x), float(y)


def _scaled(edge: Edge, share: float) -> Edge:
    """The edge drawn towards its middle, or away from it."""
    middle = edge.points.mean(axis=0)
    return replace(edge, points=middle + (edge.points - middle) * share)
