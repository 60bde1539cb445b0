"""Contact candidates: where the gel curves or has moved, one region for each contact."""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.background import quantile
from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask
from station.vision.region import Movement, level_of

_FOOT_SHARE = 0.5
"""Of the detection threshold: a candidate's foot is never lower."""
_STRONG_SHARE, _LOW_QUANTILE = 0.6, 0.3
"""Of the strongest curvature, what counts as curved; and the quantile of the level there that a body mostly reaches."""
_OVER_SPREAD = 3.0
"""In standard deviations of the background's level: a candidate is as far above it."""
_FAINT_SPREADS = 8.0
"""A faint body has moved wherever it is so many standard deviations above the background's level: one achene or a part
of the rim may outshine all else of it. At 7 and 10 the 95th percentile of bruised fruit's errors is 0.58 and 0.56 in
place of 0.55."""
_OWN_SHARE = 0.35
"""Of its own strongest place: what belongs to one of several contacts, so that a strong neighbour hides none."""
_WEAK_RADIUS_PX = 7
"""At half the working size: a contact of about 2 mm², where a weak one is searched for."""
_NECKS, _NECK_DEPTH = (0.4, 0.55, 0.7, 0.8), 0.12
"""Of the greatest depth: where several contacts are parted, and by how much both sides have to be deeper."""


class Candidates(NamedTuple):
    """Regions of possible contacts, and the image that shows them."""

    regions: list[Mask]
    """Of the curvature's shape, 0 or 1; the most likely first."""
    level: FloatImage
    """What they stand out in: the change's level, or the curvature response."""


def body_candidates(moved: Movement, threshold: float, constants: Constants) -> Candidates:
    """Find where one body may be: what has moved clear of the noise, or curves enough to reach the threshold.

    A place has moved where its level is a share of what most curved places reach; of a faint body, wherever it exceeds
    the background's noise.

    Args:
        moved: from `region.movement`.
        threshold: the detection threshold, grey levels per pixel; each region reaches it.
        constants: window and share, and the gate below which a body is faint.
    """
    curvature = moved.curvature
    seen = level_of(moved, constants.level_window)
    level = seen.levels
    strongest = float(curvature.max())
    if strongest <= threshold:
        return Candidates([], level)
    # Where the strongest curvature is just above the threshold, hardly any other place exceeds it.
    strong = level[curvature > min(threshold, _STRONG_SHARE * strongest)]
    spread_levels = seen.spread(moved)
    lowest = max(_OVER_SPREAD * spread_levels, constants.candidate_share * quantile(strong, _LOW_QUANTILE))
    if strongest < constants.sure_gate * threshold:
        lowest = min(lowest, _FAINT_SPREADS * spread_levels)
    standing_out = ((level > lowest) | (curvature > threshold)).astype(np.uint8)
    found = [part for part in _parts(standing_out) if cv2.minMaxLoc(curvature, part)[1] > threshold]
    return Candidates(_heaviest_first(level, found), level)


def around(place: tuple[int, int], moved: Movement, constants: Constants) -> Candidates:
    """Return the candidate for a contact too weak to curve the gel clearly: a small disc, and what has moved with it.

    The place is x and y, px of the movement.
    """
    seen = level_of(moved, constants.level_window)
    start = disc(seen.levels.shape, place, _WEAK_RADIUS_PX)
    _, labels = cv2.connectedComponents((seen.levels > _FAINT_SPREADS * seen.spread(moved)).astype(np.uint8))
    joined = np.unique(labels[start > 0])
    start |= np.isin(labels, joined[joined > 0]).astype(np.uint8)
    return Candidates([start], seen.levels)


def disc(shape: tuple[int, ...], place: tuple[int, int], radius_px: int) -> Mask:
    """A filled circle, 1 in 0, of a radius about x and y, in an image of a height and width."""
    empty = np.zeros(shape, np.uint8)
    return np.asarray(cv2.circle(empty, place, radius_px, color=1, thickness=cv2.FILLED), np.uint8)


def separate_candidates(curvature: FloatImage, threshold: float) -> Candidates:
    """Find where several contacts may be, a region for each.

    Of each region counts what curves at least about a third as much as its own strongest place, so that a strong
    neighbour does not hide a weak contact; what narrow necks join is parted.

    Args:
        curvature: shape (height, width), grey levels per pixel.
        threshold: the detection threshold, grey levels per pixel.
    """
    pieces: list[Mask] = []
    for whole in _parts((curvature > _FOOT_SHARE * threshold).astype(np.uint8)):
        peak = float(curvature[whole > 0].max())
        if peak > threshold:
            for part in _parts(whole * (curvature > _OWN_SHARE * peak)):
                if curvature[part > 0].max() > threshold:
                    pieces += _split_at_necks(part)
    return Candidates(_heaviest_first(curvature * curvature, pieces), curvature)


def _heaviest_first(weight: FloatImage, regions: list[Mask]) -> list[Mask]:
    if len(regions) < 2:
        return regions
    return sorted(regions, key=lambda region: -float(weight[region > 0].sum()))


def _parts(region: npt.NDArray[np.integer]) -> list[Mask]:
    count, labels = cv2.connectedComponents(np.ascontiguousarray(region))
    return [(labels == label).astype(np.uint8) for label in range(1, count)]


def _split_at_necks(region: Mask) -> list[Mask]:
    """The region in the parts that narrow necks join, or as it is; the border is no neck."""
    depth = _depth(region)
    deepest = float(depth.max())
    found: list[Mask] = []
    for share in _NECKS:
        cores = [
            core
            for core in _parts((depth > share * deepest).astype(np.uint8))
            if depth[core > 0].max() > (share + _NECK_DEPTH) * deepest
        ]
        if len(cores) > max(1, len(found)):
            found = cores
    if not found:
        return [region]
    apart = [cv2.distanceTransform(1 - core, cv2.DIST_L2, cv2.DIST_MASK_5) for core in found]
    nearest = np.argmin(np.stack(apart), axis=0)
    return [(region * (nearest == index)).astype(np.uint8) for index in range(len(found))]


def _depth(region: Mask) -> FloatImage:
    """Each place's distance from the region's edge, with the region continued beyond the image's border."""
    framed = cv2.copyMakeBorder(region, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1], np.float32)
