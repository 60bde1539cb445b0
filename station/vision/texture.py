"""Texture segmentation: a contact of achenes or drupelets is the union of what is pressed in, no smooth outline."""

import cv2
import numpy as np

from station.vision.background import Background, quantile, weighted_median
from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask
from station.vision.region import Region, radius_of

_STRONG_QUANTILE = 0.8
_LEVELS_TRIED = (0.7, 1.4)
_KNOWN_SIZES_PX, _UNKNOWN_SIZES_PX = (1.0, 7, 5, 9), (2.0, 9, 7, 5)
"""Of the smoothing, of grooves, of specks and of the room around a region: where the noise is known, and where not."""


def noise_level(length: FloatImage, background: Background, constants: Constants) -> float:
    """The change's median where nothing touches, or 0 where there is too little background to know it.

    Args:
        length: of the change, shape (height, width), grey levels.
        background: of the same frame.
        constants: how much background is enough.
    """
    return weighted_median(length, background.weight) if background.share >= constants.known_share / 2 else 0.0


def has_room_for_few(region: Mask, constants: Constants) -> bool:
    """Whether a region is small enough to hold few elements, where one of noise would count.

    A large soft body's rim is as faint as noise, and belongs to it all the same.

    Args:
        region: at the working size, 0 or not.
        constants: the radius.
    """
    return radius_of(region) < constants.element_many_radius


def strength(length: FloatImage, region: Mask) -> float:
    """What the strongest fifth of a region's change reaches, grey levels.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: shape of `length`, 0 or not, not empty.
    """
    few = length[::2, ::2][region[::2, ::2] > 0]
    return quantile(few if few.size else length[region > 0], _STRONG_QUANTILE)


def element_level(length: FloatImage, region: Mask, body: Region, noise: float, constants: Constants) -> FloatImage:
    """The change from which on a place belongs to an element that is pressed in, grey levels.

    A lone element ends where half of its change is gone; the more there are, the less the outermost are pressed, and
    the less their directions agree. Noise is no element. The less the body stands out of the noise, the more its
    region decides: the level is lower within, where flesh is fainter than an achene, and rises outwards.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not, not empty.
        body: its coherence is used.
        noise: from `noise_level`.
        constants: the levels.

    Returns:
        Shape of `length`; one for all places where the noise is not known, and for those far from the region.
    """
    p = constants
    radius_px = radius_of(region)
    few = (p.element_many_radius - radius_px) / (p.element_many_radius - p.element_few_radius)
    share = p.element_random + p.element_coherent * body.coherence + p.element_few * float(np.clip(few, 0, 1))
    strong = strength(length, region)
    least = max(share * strong, p.element_noises * noise)
    levels = np.full_like(length, least)
    if noise <= 0:
        return levels
    weak = (p.element_weak * noise) ** 2
    rise = p.element_rise * weak / (weak + strong**2)
    x, y, width, height = cv2.boundingRect(region)
    room_px = _KNOWN_SIZES_PX[-1]
    near = np.s_[max(0, y - room_px) : y + height + room_px, max(0, x - room_px) : x + width + room_px]
    levels[near] *= np.exp(rise * (_outwards(region[near], radius_px) - np.float32(p.element_level_radius)))
    return levels


def union(
    length: FloatImage, region: Mask, level: FloatImage, noise: float, constants: Constants
) -> tuple[Mask, float]:
    """What is pressed in within a region and close to it, grooves bridged and holes filled, and how sure that is.

    Args:
        length: of the change, shape (height, width), grey levels.
        region: the body's, shape of `length`, 0 or not.
        level: from `element_level`.
        noise: from `noise_level`; where it is known, less has to be smoothed and bridged.
        constants: how much a hanging on the level costs.

    Returns:
        Shape of `length`, 0 or 255; and 0 to 1, the less the more the area depends on the level.
    """
    blur_px, groove_px, speck_px, room_px = _KNOWN_SIZES_PX if noise > 0 else _UNKNOWN_SIZES_PX
    groove, speck, room = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)) for side in (groove_px, speck_px, room_px)
    )
    smooth = cv2.GaussianBlur(length, (0, 0), blur_px)
    near = np.asarray(cv2.dilate(region, room), np.uint8)
    pressed = (smooth > level).astype(np.uint8) & near
    # How much of the place a level 0.7 and one 1.4 times as high leave: twice the level, so to say.
    low, high = (1 + np.count_nonzero((smooth > factor * level) & (near > 0)) for factor in _LEVELS_TRIED)
    sure = 1 / (1 + (np.log(low / high) / constants.half_sure) ** 2)
    bridged = cv2.morphologyEx(pressed, cv2.MORPH_CLOSE, groove)
    outlines, _ = cv2.findContours(bridged, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(pressed), outlines, -1, 255, cv2.FILLED)
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, speck), np.uint8), float(sure)


def _outwards(region: Mask, radius_px: float) -> FloatImage:
    """How far out a place lies, in radii: 1 on the region's edge, less within and more beyond."""
    framed = (cv2.copyMakeBorder(region, 1, 1, 1, 1, cv2.BORDER_REPLICATE) > 0).astype(np.uint8)
    within, beyond = (cv2.distanceTransform(one, cv2.DIST_L2, cv2.DIST_MASK_5) for one in (framed, 1 - framed))
    return np.asarray(1 + (beyond - within)[1:-1, 1:-1] * np.float32(1 / radius_px), np.float32)
