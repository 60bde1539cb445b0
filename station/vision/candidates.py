"""Where contacts may lie: where the gel bends or has moved, one region for each contact."""

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.body import Movement, level_of
from station.vision.clusters import boundaries
from station.vision.contact import FloatImage, Mask

_FOOT_SHARE = 0.5
_WINDOW_PX = 3.0
_LOW_QUANTILE = 0.3
_SHARE_OF_LOW = 0.5
_OVER_SPREAD = 3.0
_BODY_SHARE = 0.12
_BRIDGE_PX = 9
_OWN_SHARE = 0.35
_LEAST_BEND = 0.01
_NECKS = (0.4, 0.55, 0.7, 0.8)
_NECK_DEPTH = 0.12


def cluster_levels(bend: FloatImage) -> list[float]:
    """The bendings that part the frame's clusters, clustered by their logarithm.

    Args:
        bend: shape (height, width), grey levels per pixel.
    """
    return [float(np.exp(cut)) for cut in boundaries(np.log(np.maximum(bend[::2, ::2], _LEAST_BEND)))]


def body_candidates(moved: Movement, bend: FloatImage, levels: list[float], threshold: float) -> list[Mask]:
    """Where one body may lie: what bends or has moved clear of the noise.

    Args:
        moved: from `body.movement`, of the bending's size.
        bend: shape (height, width), grey levels per pixel.
        levels: from `cluster_levels`.
        threshold: the gate's, grey levels per pixel; each region reaches it.

    Returns:
        Of the bending's shape, 0 or 1; the most moved first.
    """
    level, spread = level_of(moved, _WINDOW_PX)
    strong = level[bend > threshold]
    if not strong.size:
        return []
    lowest = max(_OVER_SPREAD * spread, _SHARE_OF_LOW * float(np.quantile(strong, _LOW_QUANTILE)))
    seen = ((level > lowest) | (bend > threshold)).astype(np.uint8)
    bridge = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_BRIDGE_PX, _BRIDGE_PX))
    framed = cv2.copyMakeBorder(seen, _BRIDGE_PX, _BRIDGE_PX, _BRIDGE_PX, _BRIDGE_PX, cv2.BORDER_CONSTANT)
    bridged = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, bridge)[_BRIDGE_PX:-_BRIDGE_PX, _BRIDGE_PX:-_BRIDGE_PX]
    return _heaviest_first(level, [part for part in _parts(bridged) if bend[part > 0].max() > threshold])


def separate_candidates(bend: FloatImage, levels: list[float], threshold: float) -> list[Mask]:
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
    return _heaviest_first(bend * bend, pieces)


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
