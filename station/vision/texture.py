"""A contact of seeds or drupelets: the union of what is pressed in takes the place of one smooth outline."""

import cv2
import numpy as np

from station.vision.background import weighted_median
from station.vision.contact import FloatImage, Mask
from station.vision.region import Body, quantile

_STRONG_QUANTILE = 0.8
_SHARE_OF_RANDOM, _SHARE_OF_COHERENCE = 0.04, 0.65
_SHARE_OF_FEW, _FEW_PX, _MANY_PX = 0.22, 34.0, 50.0
_LEVELS_TRIED = (0.7, 1.4)
_HALF_SURE = 0.45
_FINE_SIZES_PX, _COARSE_SIZES_PX = (1.0, 7, 5, 9), (2.0, 9, 7, 5)
"""Of the smoothing, of grooves, of specks and of the room around a region: where the noise is known, and where not."""
_WELL_KNOWN = 0.1
_NOISES, _WEAK_NOISES = 1.7, 5.0
_RISE, _WHERE_AS_IT_IS = 5.0, 0.8
"""Of the level, per radius outwards, where nothing stands out of the noise; and where it stays as it is, in radii."""


def noise_of(length: FloatImage, background: FloatImage) -> float:
    """The change's median where nothing touches, or 0 where there is too little background to tell.

    Args:
        length: of the change, shape (height, width), grey levels.
        background: how surely a place is background, shape of `length`, 0 to 1.
    """
    return weighted_median(length, background) if float(background.mean()) >= _WELL_KNOWN else 0.0


def has_room_for_few(region: Mask) -> bool:
    """Whether a region is small enough to hold few elements, where one of noise would count.

    A large soft body's rim is as faint as noise, and belongs to it all the same: bruised strawberries lose a quarter of
    their area to whatever is held against it.

    Args:
        region: at the working size, 0 or not.
    """
    return _radius(region) < _MANY_PX


def strength(length: FloatImage, region: Mask) -> float:
    """What the strongest fifth of a region's change reaches, grey levels.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: shape of `length`, 0 or not, not empty.
    """
    return quantile(length[region > 0], _STRONG_QUANTILE)


def level(length: FloatImage, region: Mask, body: Body, noise: float) -> FloatImage:
    """The change from which on a place belongs to an element that is pressed in, grey levels.

    A lone element ends where half of its change is gone; the more there are, the less the outermost are pressed, and
    the less their directions agree. Noise is no element. The less the body stands out of the noise, the more its
    region decides: the level is lower within, where flesh is fainter than a seed, and rises outwards.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not, not empty.
        body: its coherence is used.
        noise: from `noise_of`.

    Returns:
        Shape of `length`; one for all places where the noise is not known, and for those far from the region.
    """
    radius_px = _radius(region)
    few = float(np.clip((_MANY_PX - radius_px) / (_MANY_PX - _FEW_PX), 0, 1))
    share = _SHARE_OF_RANDOM + _SHARE_OF_COHERENCE * body.coherence + _SHARE_OF_FEW * few
    strong = strength(length, region)
    least = max(share * strong, _NOISES * noise)
    if noise <= 0:
        return np.full_like(length, least)
    weak = (_WEAK_NOISES * noise) ** 2
    rise = _RISE * weak / (weak + strong**2)
    levels = np.full_like(length, least)
    x, y, width, height = cv2.boundingRect(region)
    room_px = _FINE_SIZES_PX[-1]
    near = np.s_[max(0, y - room_px) : y + height + room_px, max(0, x - room_px) : x + width + room_px]
    levels[near] *= np.exp(rise * (_outwards(region[near], radius_px) - np.float32(_WHERE_AS_IT_IS)))
    return levels


def union(length: FloatImage, region: Mask, level: FloatImage, noise: float) -> tuple[Mask, float]:
    """What is pressed in within a region and close to it, grooves bridged and holes filled, and how sure that is.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        level: from `level`.
        noise: from `noise_of`; where it is known, less has to be smoothed and bridged.

    Returns:
        Shape of `length`, 0 or 255; and 0 to 1, the less the more the pressed place hangs on the level: one half
        where twice the level leaves two thirds of it.
    """
    blur_px, groove_px, speck_px, room_px = _FINE_SIZES_PX if noise > 0 else _COARSE_SIZES_PX
    groove, speck, room = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (groove_px, speck_px, room_px)
    )
    smooth = cv2.GaussianBlur(length, (0, 0), blur_px)
    near = np.asarray(cv2.dilate(region, room), np.uint8)
    pressed = (smooth > level).astype(np.uint8) & near
    low, high = (1 + np.count_nonzero((smooth > factor * level) & (near > 0)) for factor in _LEVELS_TRIED)
    sure = 1 / (1 + (np.log(low / high) / _HALF_SURE) ** 2)
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8), float(sure)


def _radius(region: Mask) -> float:
    return float(np.sqrt(cv2.countNonZero(region) / np.pi))


def _outwards(region: Mask, radius_px: float) -> FloatImage:
    """How far out a place lies, in radii: 1 on the region's edge, less within and more beyond."""
    framed = (cv2.copyMakeBorder(region, 1, 1, 1, 1, cv2.BORDER_REPLICATE) > 0).astype(np.uint8)
    within, beyond = (cv2.distanceTransform(one, cv2.DIST_L2, cv2.DIST_MASK_5) for one in (framed, 1 - framed))
    return np.asarray(1 + (beyond - within)[1:-1, 1:-1] * np.float32(1 / radius_px), np.float32)
