"""Where a body lies: the region in which the gel has moved, before its edge is looked for.

A body's edge alone misleads: seeds, drupelets and a crown outshine it, and a soft body's is weak. What the body moves
as a whole does not: the change's root mean square over a window, above the background's, is high all over the
contact, between seeds too, and its noise falls with the window. The region is the star-shaped one that gains most,
where a place gains by how far its level, capped at what most of the region reaches, lies above a share of that cap.
"""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.background import thinned, weighted_median
from station.vision.contact import FloatImage, Mask
from station.vision.contour import COSINES, SINES, closed_path
from station.vision.working import length_squared, resized

_BLUR_PX = 1.0
_LIGHT_BLUR_PX = 4.0
_LEAST_LIGHT = 0.6
_WINDOW_SHARE = 0.08
_LEAST_WINDOW_PX = 1.5
_CAP_QUANTILE = 0.38
_FIRST_SHARE = 0.5
_SHARE_OF_RANDOM, _SHARE_OF_COHERENCE, _SHARE_OF_FIELD = 0.33, 1.6, -0.2
_SHARES = (0.2, 0.76)
"""Of the cap, where the region ends: the less the change's directions agree, the weaker is a body's rim."""
_COHERENCE_WINDOW_SHARE = 0.13
_SMOOTH_SMALL, _SMOOTH, _SMOOTH_PER_SIZE = 0.7, 1.393, 0.222
_SKIN_WINDOW_SHARE, _SKIN_LEFT_OUT = 0.11, 0.25
_FINE_PX, _STRONGEST, _FINE_ON_SKIN = (3.0, 12.0), 0.9, 0.105
_SKIRT_OVER_LOWEST, _SKIRT_BEND, _BENT_QUANTILE, _BENT_SHARE = 1.5, 0.5, 0.6, 0.28
_SPAN = 1.9
_INNER_SHARE = 0.6
_STEPS = 80
_FIRST_EVERY = 2
_HALF_FROM_PX = 2.5
_STIFFNESS = 0.05
_WIDE_WINDOW_PX, _WIDE_SHARE, _FAR_LEVELS = 3.0, 0.3, 6.0
_NORMAL_OF_MEDIAN = 1.4826
_LEAST_LEVEL = 1e-3
_LEAST_BACKGROUND, _HARDLY_KNOWN, _WELL_KNOWN, _LOWEST = 0.02, 0.05, 0.1, 0.03

_Floats = npt.NDArray[np.float64]


class Movement(NamedTuple):
    """What of a frame's change the search for bodies needs, at half the working size."""

    change: FloatImage
    """Slightly smoothed, shape (height, width, 3), grey levels."""
    squared: FloatImage
    """Its squared length, shape (height, width)."""
    background: FloatImage
    """How surely a place is background, shape (height, width), 0 to 1."""
    evening: FloatImage
    """What makes up for weak light, shape (height, width), about 1."""
    bend: FloatImage
    """How much the gel bends, shape (height, width), grey levels per pixel of the working size."""


class Body(NamedTuple):
    """A body's region."""

    region: Mask
    """At half the working size, 0 or 1."""
    middle: tuple[float, float]
    """x and y there, from which it is star-shaped, px."""
    radii_px: _Floats
    """Shape (64,): how far it reaches on each ray, there; some perhaps beyond the image's border."""
    level: FloatImage
    """The change's root mean square above the background's, shape of `region`, grey levels."""
    spread_levels: float
    """Of the level's root where nothing touches."""
    coherence: float
    """How far the change's directions agree within about an eighth of the radius: the median, 0 to 1.

    Less where hardly any background is left, since the slope of the whole body is then in the change as well.
    """
    textured: bool
    """Whether seeds or drupelets turn the change's direction within a ninth of the radius; a smooth body does not."""

    @property
    def radius_px(self) -> float:
        """Of a circle of the region's area, at half the working size."""
        return _radius(self.region)


def movement(half: FloatImage, background: FloatImage, evening: FloatImage, bend: FloatImage) -> Movement:
    """Prepare a frame's change.

    Args:
        half: without drift, at half the working size, shape (height, width, 3), grey levels.
        background: shape (height, width), 0 to 1.
        evening: from `evening`, shape (height, width).
        bend: from `bending`, shape (height, width).
    """
    change = np.asarray(cv2.GaussianBlur(half, (0, 0), _BLUR_PX), np.float32)
    return Movement(change, length_squared(change), background, evening, bend)


def find_body(moved: Movement, start: Mask, others: Mask | None = None) -> Body | None:
    """Find the region of the body that a start belongs to.

    Args:
        moved: from `movement`.
        start: where the body has been seen, at half the working size, 0 or 1, not empty.
        others: what belongs to other bodies, 0 or not.

    Returns:
        The region, or None where nothing stands out of the background.
    """
    region, share, coherence = start, _FIRST_SHARE, 0.0
    within = _within(start)
    for last in (False, True):
        radius = _radius(region)
        window = max(_LEAST_WINDOW_PX, _WINDOW_SHARE * radius)
        level, spread = level_of(moved, window)
        level *= moved.evening
        cap = max(quantile(level[region > 0], _CAP_QUANTILE), _LEAST_LEVEL)
        if last:
            known = min(1.0, float(moved.background.mean()) / _WELL_KNOWN)
            coherence = known * _coherence(moved, region, _COHERENCE_WINDOW_SHARE * radius)
            share = _SHARE_OF_RANDOM + _SHARE_OF_COHERENCE * coherence + _SHARE_OF_FIELD * region.mean()
            share = float(np.clip(share, *_SHARES))
        gain = np.minimum(level * np.float32(1 / cap), 1) - np.float32(share)
        np.maximum(gain, 0, out=gain, where=within > 0)
        if others is not None:
            gain[others > 0] = -share
        moments = cv2.moments(within | region, binaryImage=True)
        middle = (moments["m10"] / moments["m00"], moments["m01"] / moments["m00"])
        every = 1 if last else _FIRST_EVERY
        radii = _most_gained(gain, middle, _SPAN * max(radius, _radius(within)), every)
        region = _drawn(middle, radii, every, (region.shape[0], region.shape[1]))
        if not region.any():
            return None
    textured = _is_textured(moved, region)
    if textured and float(moved.background.mean()) < _WELL_KNOWN:
        region, radii = _bent(moved, region, middle, radii)
    return Body(region, middle, radii, level, spread, coherence, textured)


def _bent(moved: Movement, region: Mask, middle: tuple[float, float], radii: _Floats) -> tuple[Mask, _Floats]:
    """The part of a textured body's region that bends, and its radii, or the region where none does.

    Without background the skirt's level is the body's; seeds and drupelets bend the gel, and the skirt does not.
    """
    floor = min(_SKIRT_OVER_LOWEST * quantile(thinned(moved.bend), _LOWEST), _SKIRT_BEND)
    bend = np.sqrt(np.maximum(np.square(moved.bend) - np.float32(floor**2), 0), dtype=np.float32)
    cap = max(quantile(bend[region > 0], _BENT_QUANTILE), _LEAST_LEVEL)
    gain = np.minimum(bend * np.float32(1 / cap), 1) - np.float32(_BENT_SHARE)
    bent_radii = _most_gained(gain, middle, _SPAN * _radius(region), 1)
    bent = _drawn(middle, bent_radii, 1, (region.shape[0], region.shape[1]))
    return (bent, bent_radii) if bent.any() else (region, radii)


def _is_textured(moved: Movement, region: Mask) -> bool:
    """Whether the change turns from place to place; the larger the body, the more places there are to disagree.

    Without background the fit of the drift has bent the body's own slopes, and directions tell little: there skin is
    what is finer than those slopes, times how much the strongest tenth bends; and where some is left, both.
    """
    background = float(moved.background.mean())
    if background < _WELL_KNOWN:
        strongest = quantile(moved.bend[region > 0], _STRONGEST)
        fine = _fine_share(moved.change, region) * strongest > _FINE_ON_SKIN
        if not fine or background < _HARDLY_KNOWN:
            return fine
    skin = _coherence(moved, region, _SKIN_WINDOW_SHARE * _radius(region), _SKIN_LEFT_OUT)
    if background < _WELL_KNOWN:
        return skin < _SMOOTH_SMALL
    return skin < min(_SMOOTH_SMALL, _SMOOTH - _SMOOTH_PER_SIZE * np.log(_radius(region)))


def _fine_share(change: FloatImage, region: Mask) -> float:
    """How much of a region's squared change is as fine as seeds are: the medians' ratio, or 0 in few pixels."""
    size = (change.shape[1] // 2, change.shape[0] // 2)
    change = resized(change, size)
    elements, slopes = (np.asarray(cv2.GaussianBlur(change, (0, 0), sigma / 2), np.float32) for sigma in _FINE_PX)
    inside = cv2.resize(region, size, interpolation=cv2.INTER_NEAREST) > 0
    if not inside.any():
        return 0.0
    fine, whole = (quantile(length_squared(one)[inside], 0.5) for one in (elements - slopes, elements))
    return fine / max(whole, _LEAST_LEVEL)


def has_moved_widely(moved: Movement) -> bool:
    """Whether three tenths of the frame have moved far beyond what drift leaves over.

    A large smooth body bends the gel evenly and leaves skirt for background, above whose bending it hardly stands out.
    On real backgrounds with noise, streaks and drift the level reached there was 0.5, of balls over 85 mm² it was 15.
    """
    level, _ = level_of(moved, _WIDE_WINDOW_PX)
    return quantile(thinned(level), 1 - _WIDE_SHARE) > _FAR_LEVELS


def evening(light: FloatImage) -> FloatImage:
    """What a change is multiplied by to be as large as in the mean light: a slope changes weak light by less.

    Args:
        light: the reference, shape (height, width, 3), grey levels.

    Returns:
        Shape (height, width).
    """
    total = cv2.GaussianBlur(np.sqrt(length_squared(light)), (0, 0), _LIGHT_BLUR_PX)
    mean = float(total.mean())
    return np.asarray((1 + _LEAST_LIGHT) * mean / (total + _LEAST_LIGHT * mean), np.float32)


def level_of(moved: Movement, window_px: float) -> tuple[FloatImage, float]:
    """The change's root mean square over a window above the background's, and that root's spread in the background.

    Args:
        moved: from `movement`.
        window_px: the Gaussian window's standard deviation, px of half the working size.

    Returns:
        Shape (height, width) and the spread, grey levels.
    """
    mean = cv2.GaussianBlur(moved.squared, (0, 0), window_px)
    few, weight = thinned(np.asarray(mean, np.float32)), thinned(moved.background)
    floor = _floor(few, weight)
    scatter = np.abs(np.sqrt(few) - np.sqrt(floor))
    spread = _NORMAL_OF_MEDIAN * (weighted_median(scatter, weight) if _is_seen(weight) else quantile(scatter, _LOWEST))
    return np.sqrt(np.maximum(mean - np.float32(floor), 0), dtype=np.float32), spread


def _is_seen(background: FloatImage) -> bool:
    return float(background.mean()) >= _LEAST_BACKGROUND


def _floor(field: FloatImage, background: FloatImage) -> float:
    """What a field has where nothing touches: its median there, or nearly its least where hardly anything is free."""
    return weighted_median(field, background) if _is_seen(background) else quantile(thinned(field).ravel(), _LOWEST)


def _coherence(moved: Movement, region: Mask, window_px: float, leave_out: float = 0.0) -> float:
    """Squared mean over mean square of the change in a window, both above the background's: the region's median.

    The region's mean change is taken off before: slopes point all ways, so it is light that the drift left over. The
    share `leave_out` of the region that has moved least is left out.
    """
    window_px = max(_BLUR_PX, window_px)
    change, squared = moved.change, moved.squared
    if window_px > _HALF_FROM_PX:
        size = (change.shape[1] // 2, change.shape[0] // 2)
        change, squared, window_px = resized(change, size), resized(squared, size), window_px / 2
        region = np.asarray(cv2.resize(region, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    cast = np.array(cv2.mean(change, region)[:3], np.float32)
    smooth = np.asarray(cv2.GaussianBlur(change, (0, 0), window_px), np.float32)
    mean_square = np.asarray(cv2.GaussianBlur(squared, (0, 0), window_px), np.float32)
    background = resized(moved.background, (smooth.shape[1], smooth.shape[0]))
    floors = [_floor(one, background) for one in (length_squared(smooth), mean_square)]
    inside = region > 0
    within = smooth[inside]
    agreed = np.maximum(np.square(within - cast).sum(axis=1) - floors[0], 0)
    whole = mean_square[inside] - 2 * within @ cast + cast @ cast - floors[1]
    whole = np.maximum(whole, _LEAST_LEVEL)
    kept = whole >= quantile(whole, leave_out)
    return quantile(agreed[kept] / whole[kept], 0.5)


def _most_gained(gain: FloatImage, middle: tuple[float, float], reach_px: float, every: int) -> _Floats:
    """The radii of the closed path that encloses the largest sum of gains; beyond the border nothing is gained."""
    height, width = gain.shape
    steps = _STEPS // every
    away = (np.arange(steps) + 0.5) * (reach_px / steps)
    x, y = middle[0] + COSINES[::every, None] * away, middle[1] + SINES[::every, None] * away
    along = cv2.remap(gain, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    along[(x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)] = 0
    gained = np.cumsum(along * away, axis=1) * (8 / (steps * reach_px))
    return np.asarray(away[closed_path(-gained, _STIFFNESS)], np.float64)


def _drawn(middle: tuple[float, float], radii_px: _Floats, every: int, shape: tuple[int, int]) -> Mask:
    points = np.stack([middle[0] + COSINES[::every] * radii_px, middle[1] + SINES[::every] * radii_px], axis=1)
    region = np.zeros(shape, np.uint8)
    cv2.fillPoly(region, [np.rint(points * 16).astype(np.int32)], 1, cv2.LINE_8, 4)
    return region


def _within(region: Mask) -> Mask:
    """The inner part of a region's convex hull: a flat centre lies there, be its ring closed or not."""
    outlines, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(np.concatenate(outlines))[:, 0].astype(np.float64)
    moments = cv2.moments(hull.astype(np.float32))
    inner = np.zeros_like(region)
    if moments["m00"] > 0:
        middle = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
        points = middle + (hull - middle) * _INNER_SHARE
        cv2.fillPoly(inner, [np.rint(points * 16).astype(np.int32)], 1, cv2.LINE_8, 4)
    return inner


def _radius(region: Mask) -> float:
    return max(3.0, float(np.sqrt(np.count_nonzero(region) / np.pi)))


def quantile(values: npt.NDArray[np.floating], share: float) -> float:
    """The value below which a share of all lies, of those that occur.

    Args:
        values: any shape, not empty.
        share: 0 to 1.
    """
    values = values.ravel()
    place = int(share * (values.size - 1))
    return float(np.partition(values, place)[place])
