"""Outline of one contact: along a smooth body's edge, or the union of what textured skin presses in."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.vision import texture
from station.vision.background import Background
from station.vision.confidence import background_spread, edge_confidence
from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask
from station.vision.contour import Edge, find_edge, inside_image
from station.vision.region import Region

_MARGIN_PX = 6
"""At half the working size, around a textured body: as far as its segmentation's windows reach, and a pixel more."""
_WITHIN, _BEYOND = 0.8, 1.2
"""Of the region's radius: where the fall of its level across its end is read."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """One contact's outline."""

    edge: Edge
    """At half the working size."""
    inside: Mask
    """What the edge encloses, at half the working size, or of textured skin the union of its elements there, at the
    working size; 0 or 255."""
    textured: bool
    confidence: float

    def drawn(self, height: int, width: int) -> Mask:
        """The contact at another size, shape (height, width), 0 or 255."""
        if not self.textured:
            return filled(self.edge, (height, width), (width / self.inside.shape[1], height / self.inside.shape[0]))
        grown = cv2.resize(self.inside, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(cv2.threshold(grown, 127, 255, cv2.THRESH_BINARY)[1], np.uint8)


def find_outline(
    length: FloatImage,
    body: Region,
    background: Background,
    stiffness: float,
    constants: Constants,
    floor: Mask | None = None,
) -> Outline:
    """Find the outline of the contact in a body's region.

    Args:
        length: of the smoothed change, at half the working size, shape (height, width), grey levels.
        body: found at that size.
        background: of the same frame.
        stiffness: as for `find_edge`.
        constants: as for `find_edge` and the texture.
        floor: what is surely within it, shape of `length`, 0 or not.
    """
    height, width = length.shape
    if not body.textured:
        edge = find_edge(length, body.mask, body.rays, body.radii, stiffness, constants, floor)
        confidence = edge_confidence(edge, background_spread(length, background.weight), constants)
        return Outline(edge, filled(edge, (height, width)), textured=False, confidence=confidence)
    points = body.rays.points(body.radii)
    edge = Edge(points, inside_image(points, (height, width)), _fall(body))
    left, top, across, down = cv2.boundingRect(body.mask)
    rows = slice(max(0, top - _MARGIN_PX), min(height, top + down + _MARGIN_PX))
    columns = slice(max(0, left - _MARGIN_PX), min(width, left + across + _MARGIN_PX))
    size = (2 * (columns.stop - columns.start), 2 * (rows.stop - rows.start))
    length = np.asarray(cv2.resize(length[rows, columns], size, interpolation=cv2.INTER_LINEAR), np.float32)
    region = np.asarray(cv2.resize(body.mask[rows, columns], size, interpolation=cv2.INTER_NEAREST), np.uint8)
    level = texture.element_level(length, region, body.coherence, constants)
    inside = np.zeros((2 * height, 2 * width), np.uint8)
    place = inside[2 * rows.start : 2 * rows.stop, 2 * columns.start : 2 * columns.stop]
    place[:], sure = texture.union(length, region, level, constants)
    confidence = sure * edge_confidence(edge, body.spread_levels, constants)
    return Outline(edge, inside, textured=True, confidence=confidence)


def filled(edge: Edge, shape: tuple[int, int], scale: tuple[float, float] = (1.0, 1.0)) -> Mask:
    """Return what an edge, px of half the working size, encloses: a mask, 0 or 255, of a shape, scaled along x and y.

    Pixels whose middle is enclosed. OpenCV's `fillPoly` adds those that the line touches: 1 % of a contact of 12 mm².
    """
    height, width = shape
    # Whole numbers are the pixels' middles, but sizes scale from the image's corner, half a pixel away.
    (x, y), (next_x, next_y) = ends = np.array([(edge.points + 0.5) * scale - 0.5] * 2).transpose(0, 2, 1)
    # `next_x` and `next_y` are views of `ends`, and change with it.
    ends[1] = np.roll(ends[1], -1, axis=1)
    # Down a column one is inside after each odd crossing of the edge.
    first, last = (np.clip(np.ceil(of(x, next_x)), 0, width).astype(np.intp) for of in (np.minimum, np.maximum))
    counts = last - first
    side = np.repeat(np.arange(counts.size), counts)
    column = np.arange(side.size) - np.repeat(np.cumsum(counts) - counts - first, counts)
    down = y[side] + (column - x[side]) * ((next_y - y)[side] / (next_x - x)[side])
    row = np.clip(np.ceil(down), 0, height).astype(np.intp)
    crossed = np.zeros((height + 1, -(-width // 8) * 8), np.uint8)
    np.bitwise_xor.at(crossed, (row, column), 255)
    eight_at_once = crossed.view(np.uint64)[row.min(initial=height) : row.max(initial=0) + 1]
    np.bitwise_xor.accumulate(eight_at_once, axis=0, out=eight_at_once)
    return np.ascontiguousarray(crossed[:height, :width])


def _fall(body: Region) -> npt.NDArray[np.float64]:
    """By how much a body's level falls across the end of its region, on each ray, grey levels."""
    x, y = body.rays.places(body.radii[:, None] * np.array([_WITHIN, _BEYOND]))
    levels = cv2.remap(body.level, x, y, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    return (levels[:, 0] - levels[:, 1]).astype(np.float64)
