"""Contact candidates: where the gel curves or has moved, one region for each contact."""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.background import quantile
from station.vision.clusters import boundaries
from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask
from station.vision.region import Movement, level_of

_FOOT_SHARE = 0.5
"""Of the detection threshold: a candidate's foot is never lower."""
_LOW_QUANTILE = 0.3
_STRONG_SHARE = 0.6
_BESIDE = (0.85, 1.3)
_OVER_SPREAD = 3.0
_OWN_SHARE = 0.35
_LEAST = 0.01
_WEAK_RADIUS_PX = 7
_NECKS = (0.4, 0.55, 0.7, 0.8)
_NECK_DEPTH = 0.12


class Candidates(NamedTuple):
    """Where contacts may lie, and what says so."""

    regions: list[Mask]
    """Of the curvature's shape, 0 or 1; the most likely first."""
    clustered: FloatImage
    """The quantity whose clusters are asked for: the change's level, or the curvature."""
    levels: list[float]
    """What parts its clusters, ascending."""


def body_candidates(moved: Movement, threshold: float, constants: Constants) -> Candidates:
    """Where one body may lie: what has moved clear of the noise, or curves enough to reach the threshold.

    A place has moved from half of what the curved places mostly reach on, or from the cluster boundary next to that.

    Args:
        moved: from `region.movement`.
        threshold: the detection threshold, grey levels per pixel; each region reaches it.
        constants: window, share and the gaps that are bridged.
    """
    curvature = moved.curvature
    level, spread = level_of(moved, constants.level_window)
    levels = _levels(level, max(spread, _LEAST))
    strongest = float(curvature.max())
    if strongest <= threshold:
        return Candidates([], level, levels)
    strong = level[curvature > min(threshold, _STRONG_SHARE * strongest)]
    wanted = constants.candidate_share * quantile(strong, _LOW_QUANTILE)
    beside = [cut for cut in levels if _BESIDE[0] * wanted < cut < _BESIDE[1] * wanted]
    lowest = max(_OVER_SPREAD * spread, min(beside, key=lambda cut: abs(np.log(cut / wanted)), default=wanted))
    seen = ((level > lowest) | (curvature > threshold)).astype(np.uint8)
    gap = round(constants.bridge)
    bridge = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (gap, gap))
    framed = cv2.copyMakeBorder(seen, gap, gap, gap, gap, cv2.BORDER_CONSTANT)
    bridged = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, bridge)[gap:-gap, gap:-gap]
    found = [part for part in _parts(np.asarray(bridged, np.uint8)) if curvature[part > 0].max() > threshold]
    return Candidates(_heaviest_first(level, found), level, levels)


def around(place: tuple[int, int], moved: Movement, constants: Constants) -> Candidates:
    """Where a contact too weak to curve the gel clear of the noise may lie: a small disc around its place.

    Args:
        place: x and y, px of the movement.
        moved: from `region.movement`.
        constants: the level's window.
    """
    level, spread = level_of(moved, constants.level_window)
    shape = (level.shape[0], level.shape[1])
    return Candidates([disc(shape, place, _WEAK_RADIUS_PX)], level, _levels(level, max(spread, _LEAST)))


def disc(shape: tuple[int, ...], place: tuple[int, int], radius_px: int) -> Mask:
    """A filled circle, 1 in 0.

    Args:
        shape: height and width.
        place: its middle, x and y.
        radius_px: its radius.
    """
    empty = np.zeros(shape, np.uint8)
    return np.asarray(cv2.circle(empty, place, radius_px, color=1, thickness=cv2.FILLED), np.uint8)


def separate_candidates(curvature: FloatImage, threshold: float) -> Candidates:
    """Where several contacts may lie, each for itself.

    Of each region counts what curves at least about a third as much as its own strongest place, so that a strong
    neighbour does not hide a weak contact; what narrow necks join is parted.

    Args:
        curvature: shape (height, width), grey levels per pixel.
        threshold: the detection threshold, grey levels per pixel.
    """
    levels = _levels(curvature, _LEAST)
    pieces: list[Mask] = []
    for whole in _parts((curvature > _foot(levels, threshold)).astype(np.uint8)):
        peak = float(curvature[whole > 0].max())
        if peak > threshold:
            for part in _parts(whole * (curvature > _OWN_SHARE * peak)):
                if curvature[part > 0].max() > threshold:
                    pieces += _split_at_necks(part)
    return Candidates(_heaviest_first(curvature * curvature, pieces), curvature, levels)


def _levels(field: FloatImage, least: float) -> list[float]:
    """The values that part a field's clusters, clustered by their logarithm."""
    return [float(np.exp(cut)) for cut in boundaries(np.log(np.maximum(field[::2, ::2], least)))]


def _foot(levels: list[float], threshold: float) -> float:
    """The highest cluster boundary between half the threshold and the threshold, or that half."""
    return max([_FOOT_SHARE * threshold, *(level for level in levels if level <= threshold)])


def _heaviest_first(weight: FloatImage, regions: list[Mask]) -> list[Mask]:
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
