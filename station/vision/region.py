"""Contact region: where the gel has moved under one body, before the search for the contact's edge.

A body's edge alone misleads: achenes, drupelets and a calyx outshine it, and a soft body's is weak. What the body moves
as a whole does not: the change's root mean square over a window, above the background's, is high all over the contact,
between achenes too, and its noise falls with the window. The region is the star-shaped one that gains most, where a
place gains its level, clipped at what most of the region reaches, less a share of that.
Rays are drawn in coordinates in which the region is as wide as it is long, so that a long body has a region as well.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.background import LEAST_BACKGROUND, Background, quantile, quantiles, thinned, weighted_median
from station.vision.constants import NORMAL_OF_MEDIAN, Constants
from station.vision.contact import FloatImage, Mask
from station.vision.contour import Rays, closed_path
from station.vision.working import HALF_FROM_PX, NEXT_TO_NOTHING, SUBPIXEL_BITS, blurred, length_squared, resized

CHANGE_BLUR_PX = 1.0
"""At half the working size: the noise of single pixels goes, an achene of 1 mm stays. `texture.union` uses the
same number at the working size."""
_STEPS = 80
"""On a ray. Resolution: a fortieth of the radius."""
_FIRST_EVERY = 2
"""Of the first pass, which has every second ray and step only. Resolution."""
_FLOOR_QUANTILE = 0.03
"""Of a field without background: nearly its least."""
_LEAST_WINDOW_PX = 1.5
"""Of the level's window, at half the working size. At 1 the fit's cost is 0.002 higher."""
_LEAST_RADIUS_PX = 3.0
"""At half the working size, 0.3 mm: what is smaller has no window of its own."""
_SURELY_SMOOTH = 0.7
"""Coherence, with the places that have moved least, from which it is not measured once more: of 1,182 regions of
the fit's data none above 0.62 is skin."""
_STRONG_QUANTILE, _STRONGEST_QUANTILE = 0.9, 0.97
"""Of a region's curvature: its strong part, and the strongest less what noise adds. With 0.9 for both the fit's cost is
0.001 to 0.003 higher."""

_Floats = npt.NDArray[np.float64]


class Movement(NamedTuple):
    """Change of a frame, prepared for the search for regions, at half the working size."""

    change: FloatImage
    """Slightly smoothed, shape (height, width, 3), grey levels."""
    squared: FloatImage
    """Its squared length, shape (height, width)."""
    length: FloatImage
    """Its length, shape (height, width), grey levels."""
    weight: FloatImage
    """How surely a place is background, shape (height, width), 0 to 1."""
    share: float
    """How much of the frame is background, 0 to 1."""
    flat_field: FloatImage
    """The flat-field correction, shape (height, width), about 1."""
    curvature: FloatImage
    """The curvature response, shape (height, width), grey levels per pixel of the working size."""


class Region(NamedTuple):
    """A body's contact region."""

    mask: Mask
    """At half the working size, 0 or 1."""
    rays: Rays
    """The rays on which it is star-shaped, at half the working size."""
    radii: _Floats
    """Shape (64,): how far it reaches on each ray, in the rays' unit; some perhaps beyond the image's border."""
    level: FloatImage
    """The change's root mean square above the background's, shape of `mask`, grey levels."""
    spread_levels: float
    """Standard deviation of the level's root where nothing touches."""
    coherence: float
    """How far the change's directions agree within about an eighth of the radius: the median, 0 to 1."""
    textured: bool
    """Whether achenes or drupelets turn the change's direction within about an eighth of the radius."""


def movement(half: FloatImage, background: Background, flat_field: FloatImage, curvature: FloatImage) -> Movement:
    """Prepare a frame's change without background, at half the working size, shape (height, width, 3), grey levels."""
    change = np.asarray(cv2.GaussianBlur(half, (0, 0), CHANGE_BLUR_PX), np.float32)
    weight = resized(background.weight, (half.shape[1], half.shape[0]))
    squared = length_squared(change)
    length = np.asarray(cv2.sqrt(squared), np.float32)
    return Movement(change, squared, length, weight, background.share, flat_field, curvature)


def flat_field_correction(light: FloatImage, constants: Constants) -> FloatImage:
    """Return the factor that makes a change as large as in the mean light: a slope changes weak light by less.

    Args:
        light: the reference at half the working size, shape (height, width, 3), grey levels.
        constants: smoothing, and the limit in the dark.

    Returns:
        Shape (height, width).
    """
    total = cv2.GaussianBlur(np.sqrt(length_squared(light)), (0, 0), constants.flat_field_blur)
    mean, floor = float(total.mean()), constants.flat_field_floor
    return np.asarray((1 + floor) * mean / (total + floor * mean), np.float32)


def find_region(
    moved: Movement,
    start: Mask,
    constants: Constants,
    others: Mask | None = None,
    floor: Mask | None = None,
    *,
    texture: bool | None = None,
) -> Region | None:
    """Find the region of the body that a start belongs to.

    Args:
        moved: from `movement`.
        start: where the body has been seen, at half the working size, 0 or 1, not empty.
        constants: windows and shares.
        others: what belongs to other bodies, 0 or not.
        floor: what has belonged to it at the press's last step, 0 or not, and so does now.
        texture: whether it is textured where that is known.

    Returns:
        The region, or None where nothing exceeds the background.
    """
    p = constants
    shape = (start.shape[0], start.shape[1])
    mask, share, coherence, agreed = start, p.candidate_share, 0.0, 0.0
    halved = _halved(moved)
    inner = _inner_hull(start, p.hull_share)
    if floor is not None:
        inner |= floor
    # A flat centre has not moved; it lies within what has, and costs nothing. Elsewhere no gain is as low as -1.
    least_gain = inner.astype(np.float32) - 1
    # Twice, since windows and shares go with the region's size: with one pass drupelets are measured worse.
    for last in (False, True):
        radius = radius_of(mask)
        # A long body's window goes with its width: the level that a wider one spreads beyond it would count as body.
        window_px = p.region_window * radius * Rays.about(mask).across
        seen = level_of(moved, max(_LEAST_WINDOW_PX, window_px))
        level = seen.levels * moved.flat_field
        # Clipped, so that the rim of a ball or an achene weighs no more than the rest of the contact.
        inside = mask > 0
        cap, middle = (max(one, NEXT_TO_NOTHING) for one in quantiles(level[inside], p.cap_quantile, 0.5))
        if last:
            agreed = _coherence(moved, halved, mask, p.coherence_window * radius)
            # With hardly any background the model has bent the body's own slopes, and directions say little.
            coherence = agreed * min(1.0, 2 * moved.share / p.known_share)
            # The more the directions agree, the smoother the body, and the stronger its halo outside the edge. The more
            # achenes or drupelets outshine the body, the further their part of the windowed level reaches beyond it.
            share = p.share_even + p.share_coherent * coherence + p.share_field * (cv2.countNonZero(mask) / mask.size)
            # How far elements outshine the body, 1/px.
            strongest = max(quantile(moved.curvature[inside], _STRONGEST_QUANTILE), NEXT_TO_NOTHING)
            prominence = max(math.log(strongest / middle), p.least_prominence)
            share = min(max(share + p.share_prominent * prominence, p.share_least), p.share_most)
        gain = _clipped(level, cap) - np.float32(share)
        np.maximum(gain, least_gain, out=gain)
        # After the hull's limit: another body's places cost within the hull too.
        if others is not None:
            gain[others > 0] = -share
        if floor is not None:
            gain[floor > 0] = 1 - share
        # With the hull: the middle of an open ring would be drawn towards its closed side.
        rays = Rays.about(inner | mask)
        every = 1 if last else _FIRST_EVERY
        # The rays' axes have the determinant 1 and keep an area: its radius in px is one in the rays' unit too.
        radii = _most_gained(gain, rays, p.region_span * radius_of(inner | mask), every, p.path_stiffness)
        mask = _drawn(rays, radii, every, shape)
        if not mask.any():
            return None
    is_known = moved.share >= p.known_share / 2
    if texture is None:
        texture = (
            _is_skin(moved, halved, mask, agreed, p) if is_known else _is_skin_by_curvature(moved, halved, mask, p)
        )
    if texture and not is_known:
        mask, radii = _curved(moved, mask, rays, radii, p)
        if floor is not None:
            mask |= floor
    return Region(mask, rays, radii, level, seen.spread(moved), coherence, texture)


def _halved(moved: Movement) -> Movement:
    """Return the part of a movement that wide windows need, at half its size."""
    size = (moved.change.shape[1] // 2, moved.change.shape[0] // 2)
    change, squared, weight = (resized(one, size) for one in (moved.change, moved.squared, moved.weight))
    return moved._replace(change=change, squared=squared, weight=weight)


def _curved(moved: Movement, region: Mask, rays: Rays, radii: _Floats, constants: Constants) -> tuple[Mask, _Floats]:
    """The part of a textured body's region that curves, and its radii, or the region where none does.

    Without background the halo's level is the body's; achenes and drupelets curve the gel, and the halo does not.
    """
    p = constants
    halo = min(p.halo_over_least * quantile(thinned(moved.curvature), _FLOOR_QUANTILE), p.halo_curvature)
    curvature = np.sqrt(np.maximum(np.square(moved.curvature) - np.float32(halo**2), 0), dtype=np.float32)
    cap = max(quantile(curvature[region > 0], p.curved_quantile), NEXT_TO_NOTHING)
    gain = _clipped(curvature, cap) - np.float32(p.curved_share)
    curved_radii = _most_gained(gain, rays, p.region_span * radius_of(region), 1, p.path_stiffness)
    curved = _drawn(rays, curved_radii, 1, (region.shape[0], region.shape[1]))
    return (curved, curved_radii) if curved.any() else (region, radii)


def _is_skin(moved: Movement, halved: Movement, region: Mask, agreed: float, constants: Constants) -> bool:
    """Return whether a region is skin: the change turns from place to place, more than its size alone explains."""
    p, radius = constants, radius_of(region)
    if agreed >= _SURELY_SMOOTH:
        return False
    smooth = min(p.smooth_small, p.smooth_at_one - p.smooth_per_size * float(np.log(radius)))
    return _coherence(moved, halved, region, p.coherence_window * radius, p.skin_left_out) < smooth


def _is_skin_by_curvature(moved: Movement, halved: Movement, region: Mask, constants: Constants) -> bool:
    """Return whether a region is skin, where there is hardly any background and directions are unreliable.

    Skin is what is finer than the body's own slopes, times how much the strongest tenth curves.
    """
    strong = quantile(moved.curvature[region > 0], _STRONG_QUANTILE)
    return _fine_share(halved.change, region, constants) * strong > constants.fine_on_skin


def _fine_share(change: FloatImage, region: Mask, constants: Constants) -> float:
    """Return the share of a region's squared change that is as fine as achenes: medians' ratio, 0 in too few pixels."""
    size = (change.shape[1], change.shape[0])
    # The constants are for the half grid, and this change has half of that size.
    sigmas = (constants.level_window / 2, constants.coarse_blur / 2)
    elements, slopes = (np.asarray(cv2.GaussianBlur(change, (0, 0), sigma), np.float32) for sigma in sigmas)
    inside = cv2.resize(region, size, interpolation=cv2.INTER_NEAREST) > 0
    if not inside.any():
        return 0.0
    fine, whole = (quantile(length_squared(one)[inside], 0.5) for one in (elements - slopes, elements))
    return fine / max(whole, NEXT_TO_NOTHING)


def has_moved_widely(moved: Movement, constants: Constants) -> bool:
    """Return whether much of the frame has moved far beyond what drift and compression leave over."""
    levels = level_of(moved, constants.level_window).levels
    return quantile(thinned(levels), 1 - constants.wide_share) > constants.wide_levels


class Level(NamedTuple):
    """Strength of the change at each place, above the background's."""

    levels: FloatImage
    """The change's root mean square over a window above the background's, shape (height, width), grey levels."""
    roots: FloatImage
    """The root mean square itself, every few pixels."""
    background_root: float
    """The background's."""

    def spread(self, moved: Movement) -> float:
        """The root's standard deviation in the background of the movement that the level is of, grey levels."""
        return NORMAL_OF_MEDIAN * _in_background(np.abs(self.roots - self.background_root), moved)


def level_of(moved: Movement, window_px: float) -> Level:
    """The change's level in a Gaussian window of a standard deviation in px of half the working size."""
    mean = blurred(moved.squared, window_px)
    few = thinned(mean)
    floor = _in_background(few, moved)
    above = np.maximum(mean - np.float32(floor), 0)
    return Level(np.sqrt(above, out=above), np.sqrt(few), math.sqrt(floor))


def _in_background(few: FloatImage, moved: Movement) -> float:
    """The median of a thinned field in the background, or nearly its least where there is hardly any."""
    if moved.share < LEAST_BACKGROUND:
        return quantile(few, _FLOOR_QUANTILE)
    return weighted_median(few, thinned(moved.weight))


def _clipped(field: FloatImage, cap: float) -> FloatImage:
    """A field in units of a cap, at which it is clipped."""
    shares = field * np.float32(1 / cap)
    return np.minimum(shares, 1, out=shares)


def _coherence(moved: Movement, halved: Movement, region: Mask, window_px: float, left_out: float = 0.0) -> float:
    """Squared mean over mean square of the change in a window, both above the background's: the region's median.

    The region's mean change is taken off before: slopes point all ways, so it is light that the model left over. The
    share of the region that has moved least is left out: noise has no direction.
    """
    window_px = max(CHANGE_BLUR_PX, window_px)
    if window_px > HALF_FROM_PX:
        moved, window_px = halved, window_px / 2
        size = (moved.change.shape[1], moved.change.shape[0])
        region = np.asarray(cv2.resize(region, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    smooth = np.asarray(cv2.GaussianBlur(moved.change, (0, 0), window_px), np.float32)
    mean_square = np.asarray(cv2.GaussianBlur(moved.squared, (0, 0), window_px), np.float32)
    seen = moved.share >= LEAST_BACKGROUND
    floors = [
        weighted_median(one, moved.weight) if seen else quantile(thinned(one), _FLOOR_QUANTILE)
        for one in (length_squared(smooth), mean_square)
    ]
    # The windowed square of the change less its cast is expanded, so that it needs no second blur.
    cast = np.array(cv2.mean(moved.change, region))
    square = length_squared(np.asarray(cv2.subtract(smooth, cast), np.float32))
    cast = cast[:3].astype(np.float32)
    mean_square -= 2 * (smooth.reshape(-1, 3) @ cast).reshape(square.shape)
    inside = region > 0
    agreed = np.maximum(square[inside] - floors[0], 0)
    whole = np.maximum(mean_square[inside] + cast @ cast - floors[1], NEXT_TO_NOTHING)
    if left_out:
        kept = whole >= quantile(whole, left_out)
        agreed, whole = agreed[kept], whole[kept]
    return quantile(agreed / whole, 0.5)


def _most_gained(gain: FloatImage, rays: Rays, reach: float, every: int, stiffness: float) -> _Floats:
    """The radii of the closed path that encloses the largest sum of gains; beyond the border nothing is gained."""
    height, width = gain.shape
    steps = _STEPS // every
    away = (np.arange(steps, dtype=np.float64) + 0.5) * (reach / steps)
    x, y = rays.places(away, every)
    along = cv2.remap(gain, x, y, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    along[(x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)] = 0
    # A place's weight is its distance from the middle: the sum over rays is then the sum over the area.
    # The factor makes a full ray's gain 4 at every reach, so that the path's stiffness means the same for every size.
    gained = np.cumsum(along * away, axis=1) * (8 / (steps * reach))
    return np.asarray(away[closed_path(-gained, stiffness)], np.float64)


def _drawn(rays: Rays, radii: _Floats, every: int, shape: tuple[int, int]) -> Mask:
    x, y = rays.places(radii[:, None], every)
    mask = np.zeros(shape, np.uint8)
    points = np.rint(np.concatenate([x, y], axis=1) * (1 << SUBPIXEL_BITS)).astype(np.int32)
    return np.asarray(cv2.fillPoly(mask, [points], 1, cv2.LINE_8, SUBPIXEL_BITS), np.uint8)


def _inner_hull(region: Mask, share: float) -> Mask:
    """The inner part of a region's convex hull: it contains a flat centre, be its ring closed or not."""
    outlines, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(np.concatenate(outlines))[:, 0].astype(np.float64)
    moments = cv2.moments(hull.astype(np.float32))
    inner = np.zeros_like(region)
    if moments["m00"] > 0:
        middle = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
        points = middle + (hull - middle) * share
        cv2.fillPoly(inner, [np.rint(points * (1 << SUBPIXEL_BITS)).astype(np.int32)], 1, cv2.LINE_8, SUBPIXEL_BITS)
    return inner


def radius_of(region: Mask) -> float:
    """The radius of a circle of a region's area, at least 3, px."""
    return max(_LEAST_RADIUS_PX, float(np.sqrt(cv2.countNonZero(region) / np.pi)))
