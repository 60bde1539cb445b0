"""Where contacts may lie: regions of strong bending, one for each contact."""

from typing import NamedTuple

import cv2
import numpy as np

from station.vision.clusters import boundaries
from station.vision.confidence import background_spread
from station.vision.contact import FloatImage, Mask
from station.vision.drift import weighted_median
from station.vision.edge_signal import length_of

_FOOT_SHARE = 0.5
_BODY_SHARE = 0.12
_BRIDGE_SHARE = 0.05
_OWN_SHARE = 0.35
_LEAST_BEND = 0.01
_CHANGE_SIGMA_PX = 2.5
_CHANGE_OVER_NOISE = 5.0
_CHANGE_OVER_STREAK = 2.5
_STREAK_QUANTILE = 0.25
_SPECK_PX = 5
_NECKS = (0.4, 0.55, 0.7, 0.8)
_NECK_DEPTH = 0.12


class Candidate(NamedTuple):
    """A region that may hold one contact."""

    region: Mask
    """Shape of the bending, 0 or 1."""
    weight: float
    """The bending's square, summed: the larger, the more likely the contact meant."""


def cluster_levels(bend: FloatImage) -> list[float]:
    """The bendings that part the frame's clusters, clustered by their logarithm.

    Args:
        bend: shape (height, width), grey levels per pixel.
    """
    return [float(np.exp(cut)) for cut in boundaries(np.log(np.maximum(bend[::2, ::2], _LEAST_BEND)))]


def changed_places(change: FloatImage, background: FloatImage) -> Mask:
    """Where the change is larger than noise and streaks: a large, soft contact changes much where it bends little.

    A column's lower quartile is what its streak reaches; a place has to stand out of that as well.

    Args:
        change: without drift, at half the working size, shape (height, width, 3), grey levels.
        background: shape (height, width), 0 to 1.

    Returns:
        Shape (height, width), 0 or 1; small specks are left out.
    """
    length = length_of(np.asarray(cv2.GaussianBlur(change, (0, 0), _CHANGE_SIGMA_PX), np.float32))
    noise = weighted_median(length, background) + _CHANGE_OVER_NOISE * background_spread(length, background)
    quartile = int(_STREAK_QUANTILE * len(length))
    streak = _CHANGE_OVER_STREAK * np.partition(length, quartile, axis=0)[quartile]
    changed = (length > np.maximum(noise, streak)).astype(np.uint8)
    speck = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_SPECK_PX, _SPECK_PX))
    return np.asarray(cv2.morphologyEx(changed, cv2.MORPH_OPEN, speck), np.uint8)


def extended(region: Mask, changed: Mask) -> Mask:
    """A region with all changed places that hang together with it.

    Args:
        region: shape (height, width), 0 or 1.
        changed: from `changed_places`, shape of `region`.
    """
    _, labels = cv2.connectedComponents(region | changed)
    inside = np.unique(labels[region > 0])
    return np.isin(labels, inside).astype(np.uint8)


def body_candidates(
    bend: FloatImage, levels: list[float], threshold: float, changed: Mask | None = None
) -> list[Candidate]:
    """Where one body may touch: strong bending, bridged over the gaps between seeds and drupelets.

    Args:
        bend: shape (height, width), grey levels per pixel.
        levels: from `cluster_levels`.
        threshold: the gate's, grey levels per pixel.
        changed: from `changed_places`, where a region may lie although it bends less.

    Returns:
        The heaviest first.
    """
    strong = (bend > max(_foot(levels, threshold), _BODY_SHARE * float(bend.max()))).astype(np.uint8)
    if changed is not None:
        strong |= changed
    side = 2 * round(_BRIDGE_SHARE * max(bend.shape) / 2) + 1
    bridge = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    framed = cv2.copyMakeBorder(strong, side, side, side, side, cv2.BORDER_CONSTANT)
    bridged = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, bridge)[side:-side, side:-side]
    return _by_weight(
        bend, [part for part in _parts(np.asarray(bridged, np.uint8)) if bend[part > 0].max() > threshold]
    )


def separate_candidates(bend: FloatImage, levels: list[float], threshold: float) -> list[Candidate]:
    """Where several contacts may lie, each for itself.

    Of each region counts what bends at least about a third as much as its own strongest place, so that a strong
    neighbour does not hide a weak contact; what narrow necks join is parted.

    Args:
        bend: shape (height, width), grey levels per pixel.
        levels: from `cluster_levels`.
        threshold: the gate's, grey levels per pixel.

    Returns:
        The heaviest first.
    """
    pieces: list[Mask] = []
    for whole in _parts((bend > _foot(levels, threshold)).astype(np.uint8)):
        peak = float(bend[whole > 0].max())
        if peak > threshold:
            for part in _parts(whole * (bend > _OWN_SHARE * peak)):
                if bend[part > 0].max() > threshold:
                    pieces += _split_at_necks(part)
    return _by_weight(bend, pieces)


def _foot(levels: list[float], threshold: float) -> float:
    """The highest cluster boundary between half the threshold and the threshold, or that half."""
    return max([_FOOT_SHARE * threshold, *(level for level in levels if level <= threshold)])


def _by_weight(bend: FloatImage, regions: list[Mask]) -> list[Candidate]:
    candidates = [Candidate(region, float((bend[region > 0] ** 2).sum())) for region in regions]
    return sorted(candidates, key=lambda candidate: -candidate.weight)


def _parts(region: Mask) -> list[Mask]:
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
