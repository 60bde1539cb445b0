"""Contour by polar dynamic programming: where the change falls off most steeply on rays from the contact's middle.

The change's length grows from the flat centre to the contact's edge and falls in the halo of gel around it; the
steepest fall marks the edge. On each ray the length is first replaced by the largest further out, so that the fall
towards the flat centre is none. The steepest closed path over all rays that does not jump is found by dynamic
programming (Viterbi), twice: about the region's middle and about the first path's.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.constants import Constants
from station.vision.contact import FloatImage, Mask

RAYS = 64
"""Around a contact. Resolution: 5.6° apart."""
_FIRST_SHARES, _SECOND_SHARES = np.linspace(0.3, 1.2, 32), np.linspace(0.6, 1.4, 64)
"""In radii, where the edge is searched for about the region's middle and about the first path's."""
_LONGEST_JUMP = 2
"""Steps from ray to ray, at a price that rises with their square. Resolution of the path."""
_SIDE_SHARE = 0.15
"""Of the radius: on either side of the edge, where the drop across it is read."""
_ASPECTS, _STRETCHES = (2.0, 3.0, 8.0), (1.0, 3.0, 8.0)
"""Length over width of a region, and how far its rays are stretched: fruit is drawn on equal rays, a stem is not."""
_REACH_STEP_PX = 1.0
"""On a ray, in which a mask's reach is found. Resolution."""

_Floats = npt.NDArray[np.float64]
_ANGLES = np.arange(RAYS) * (2 * np.pi / RAYS)
"""Of the rays, rad: a whole turn."""
_CIRCLE = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class Rays(NamedTuple):
    """Sixty-four rays from a body's middle, stretched along it where it is long."""

    middle: tuple[float, float]
    """x and y, px."""
    axes: _Floats
    """Shape (2, 2), of determinant 1: takes a circle to an ellipse that is as long as the body."""

    @classmethod
    def about(cls, mask: Mask) -> Self:
        """The rays of a region, shape (height, width), 0 or not, not empty."""
        # Sums over every second row and column: `cv2.moments` of a mask takes forty times as long.
        inside = (mask[::2, ::2] > 0).astype(np.float32)
        y, x = (np.arange(0.5, 2 * side, 2, dtype=np.float32) for side in inside.shape)
        columns, rows = cv2.reduce(inside, 0, cv2.REDUCE_SUM)[0], cv2.reduce(inside, 1, cv2.REDUCE_SUM)[:, 0]
        area = max(1.0, float(columns.sum()))
        middle = (float(columns @ x) / area, float(rows @ y) / area)
        x, y = x - np.float32(middle[0]), y - np.float32(middle[1])
        xx, yy, xy = (float(value) / area for value in (columns @ (x * x), rows @ (y * y), y @ inside @ x))
        # The covariance's eigenvalues, a pixel's own added, are mean + apart and mean - apart.
        mean, turned = (xx + yy) / 2 + 1, (xx - yy) / 2
        apart = math.hypot(turned, xy)
        aspect = float(np.interp(math.sqrt((mean + apart) / (mean - apart)), _ASPECTS, _STRETCHES))
        even, longer = (aspect**0.5 + aspect**-0.5) / 2, (aspect**0.5 - aspect**-0.5) / 2
        cosine, sine = (turned / apart, xy / apart) if apart else (1.0, 0.0)  # of twice the long axis's angle
        return cls(middle, np.array([[even + longer * cosine, longer * sine], [longer * sine, even - longer * cosine]]))

    @property
    def across(self) -> float:
        """By how much a body is narrower than a circle of its area, 0 to 1; 1 of all that are not long."""
        even = float(self.axes[0, 0] + self.axes[1, 1]) / 2  # the mean of two eigenvalues whose product is 1
        return even - math.sqrt(max(0.0, even**2 - 1))

    def places(self, away: _Floats, every: int = 1) -> tuple[FloatImage, FloatImage]:
        """The places at distances in the rays' unit, shape (steps,) or (rays, steps), on every ray or every n-th one.

        Returns:
            x and y, each of shape (rays, steps), dtype float32, px.
        """
        directions = self.axes @ _CIRCLE[:, ::every]
        x, y = (np.array(self.middle)[:, None, None] + directions[:, :, None] * away).astype(np.float32)
        return x, y

    def points(self, radii: _Floats) -> _Floats:
        """The points, shape (64, 2), at distances in the rays' unit, shape (64,)."""
        return self.middle + (self.axes @ (_CIRCLE * radii)).T

    def moved_to(self, points: _Floats, shape: tuple[int, int]) -> tuple[Self, _Floats]:
        """Rays from the middle, kept in the image, of a closed line, shape (64, 2), px, and its distances on them."""
        moments = cv2.moments(points.astype(np.float32))
        if moments["m00"] <= 0:
            return self, np.hypot(*(np.linalg.inv(self.axes) @ (points - self.middle).T))
        middle = (
            float(np.clip(moments["m10"] / moments["m00"], 0, shape[1] - 1)),
            float(np.clip(moments["m01"] / moments["m00"], 0, shape[0] - 1)),
        )
        across, down = np.linalg.inv(self.axes) @ (points - middle).T
        radii = np.interp(_ANGLES, np.arctan2(down, across), np.hypot(across, down), period=2 * np.pi)
        return self._replace(middle=middle), radii


@dataclass(frozen=True, slots=True)
class Edge:
    """A closed edge and what the image shows across it."""

    points: _Floats
    """Shape (64, 2), x and y in pixels, some perhaps beyond the image's border."""
    seen: npt.NDArray[np.bool_]
    """Shape (64,): whether the point lies in the image."""
    drop_levels: _Floats
    """Shape (64,): by how much the change falls across the edge there, grey levels."""


def find_edge(
    length: FloatImage,
    region: Mask,
    rays: Rays,
    radii: _Floats,
    stiffness: float,
    constants: Constants,
    floor: Mask | None = None,
) -> Edge:
    """Find the edge of the contact in a region; a contact that the border cuts is completed by its mirror image.

    Args:
        length: of the smoothed change, shape (height, width), grey levels.
        region: where the contact is, with its halo, shape (height, width), 0 or not.
        rays: the region's, at that size.
        radii: how far the region reaches on them, shape (64,).
        stiffness: cost of a jump of one step between neighbouring rays, in units of a steep ray's fall.
        constants: which fall counts as steep, and when a contact is mirrored.
        floor: what is surely within the edge, 0 or not.
    """
    left, top, right, bottom = (0, 0, 0, 0) if floor is not None else _mirrored(region, constants)
    if not (left or top or right or bottom):
        return _closed_edge(length, rays, radii, stiffness, constants, floor)
    # With its middle near the border a contact shows part of its edge only, and the way to its flat centre falls like
    # an edge. With its mirror image it is closed.
    sides = (top, bottom, left, right, cv2.BORDER_REFLECT_101)
    length_twice = np.asarray(cv2.copyMakeBorder(length, *sides), np.float32)
    region_twice = np.asarray(cv2.copyMakeBorder(region, *sides), np.uint8)
    rays_twice = Rays.about(region_twice)
    radii_twice = _reach(region_twice, rays_twice)
    completed = _closed_edge(length_twice, rays_twice, radii_twice, stiffness, constants, None)
    points = completed.points - (left, top)
    shape = (length.shape[0], length.shape[1])
    return Edge(points, inside_image(points, shape), completed.drop_levels)


def _closed_edge(
    length: FloatImage, rays: Rays, radii: _Floats, stiffness: float, constants: Constants, floor: Mask | None
) -> Edge:
    shape = (length.shape[0], length.shape[1])
    seen = inside_image(rays.points(radii), shape)
    if seen.any() and not seen.all():  # beyond the border the region says nothing: as far as it reaches elsewhere
        radii = np.where(seen, radii, np.maximum(radii, np.median(radii[seen])))
    radii = _smooth(radii, constants.highest_harmonic)
    radii, _ = _steepest(length, rays, radii, _FIRST_SHARES, stiffness, constants, floor)
    rays, radii = rays.moved_to(rays.points(radii), shape)
    radii = _smooth(radii, constants.highest_harmonic)
    radii, drop = _steepest(length, rays, radii, _SECOND_SHARES, stiffness, constants, floor)
    points = rays.points(radii)
    return Edge(points, inside_image(points, shape), drop)


def _mirrored(region: Mask, constants: Constants) -> tuple[int, int, int, int]:
    """By how much to continue the image beyond its left, upper, right and lower border with its mirror image, px.

    Not where a contact reaches opposite borders: it fills the field instead.
    """
    _, _, width, height = cv2.boundingRect(region)
    # In order around the image: neighbours in the list meet in a corner.
    sides = ((width, region[:, 0]), (height, region[0]), (width, region[:, -1]), (height, region[-1]))
    lengths = (height, width, height, width)
    chords = [np.count_nonzero(side) / length for (_, side), length in zip(sides, lengths, strict=True)]
    if min(chords[0], chords[2]) > 0 or min(chords[1], chords[3]) > 0:
        return 0, 0, 0, 0
    found = [0, 0, 0, 0]
    for number, (across, _) in enumerate(sides):
        in_corner = max(chords[number - 1], chords[(number + 1) % 4]) > constants.corner_chord
        if chords[number] > (constants.corner_chord if in_corner else constants.border_chord):
            # As far as the region extends: its mirror image reaches no further.
            found[number] = across
    left, top, right, bottom = found
    return left, top, right, bottom


def _reach(region: Mask, rays: Rays) -> _Floats:
    """Return the reach of a region on each ray, in the rays' unit."""
    steps = np.arange(1.0, np.hypot(*region.shape), _REACH_STEP_PX)
    x, y = rays.places(steps)
    values = cv2.remap(region, x, y, cv2.INTER_NEAREST, None, cv2.BORDER_CONSTANT)
    return np.asarray(np.where(values > 0, steps, 2.0).max(axis=1), np.float64)


def inside_image(points: _Floats, shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Mark the points, shape (n, 2), x and y in px, that are in an image of this height and width."""
    return (points >= 0).all(axis=1) & (points[:, 0] <= shape[1] - 1) & (points[:, 1] <= shape[0] - 1)


def _smooth(radii: _Floats, highest_harmonic: float) -> _Floats:
    spectrum = np.fft.rfft(radii)
    spectrum *= np.exp(-0.5 * (np.arange(spectrum.size) / highest_harmonic) ** 2)
    return np.maximum(np.fft.irfft(spectrum, RAYS), 1.0)


def _steepest(
    length: FloatImage,
    rays: Rays,
    radii: _Floats,
    shares: _Floats,
    stiffness: float,
    constants: Constants,
    floor: Mask | None,
) -> tuple[_Floats, _Floats]:
    """The radius of the steepest path and the drop across it, per ray."""
    height, width = length.shape
    x, y = rays.places(radii[:, None] * shares)
    profile = cv2.remap(length, x, y, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    # The largest further out: on the way to the flat centre nothing falls.
    profile = np.maximum.accumulate(profile[:, ::-1], axis=1)[:, ::-1]
    fall = np.zeros_like(profile)
    np.subtract(profile[:, :-2], profile[:, 2:], out=fall[:, 1:-1])
    fall[(x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)] = 0
    if floor is not None:
        fall[cv2.remap(floor, x, y, cv2.INTER_NEAREST, None, cv2.BORDER_CONSTANT) > 0] = 0
    steepest = np.sort(fall.max(axis=1))
    steepest = steepest[steepest > 0]
    strong = steepest[int(constants.strong_quantile * (steepest.size - 1))] if steepest.size else 1.0
    least = constants.least_steepness
    # A place is worth 1 at most: a few very steep rays cannot pull the path away from all others.
    reward = np.maximum(np.minimum(fall * (1 / strong), 1) - least, 0) * (1 / (1 - least))
    path = closed_path(-reward, stiffness)
    side = max(1, round(_SIDE_SHARE / (shares[1] - shares[0])))
    each = np.arange(RAYS)
    drop = profile[each, np.maximum(path - side, 0)] - profile[each, np.minimum(path + side, len(shares) - 1)]
    return radii * shares[path], drop.astype(np.float64)


def closed_path(cost: npt.NDArray[np.floating], stiffness: float) -> npt.NDArray[np.intp]:
    """The cheapest path around: run over one and a half turns, of which the middle one is taken.

    It is followed from both ends at once until they meet, which is exact and halves the steps.

    Args:
        cost: of each step on each ray, shape (rays, steps); a path jumps two steps at most from ray to ray.
        stiffness: price of a jump of one step; of two steps it is four times that.

    Returns:
        Shape (rays,): the step on each ray.
    """
    rays, steps = cost.shape
    turns = np.concatenate([cost, cost[: rays // 2]])
    # Both directions side by side, so that one call advances both; infinite columns between them bar a way across.
    half, other = len(turns) // 2, steps + _LONGEST_JUMP
    width = other + steps
    padded = np.full((half, width + 2 * _LONGEST_JUMP), np.inf, np.float32)
    # Where a path comes from, by its jump: the same rows moved.
    moved = [padded[:, first : first + width] for first in range(2 * _LONGEST_JUMP + 1)]
    sums = moved[_LONGEST_JUMP]
    sums[:, :steps], sums[:, other:] = turns[:half], turns[: half - 1 : -1]
    prices = stiffness * np.arange(-_LONGEST_JUMP, _LONGEST_JUMP + 1, dtype=np.float32) ** 2
    jumped = np.empty((_LONGEST_JUMP, width), np.float32)
    added = np.repeat(prices[:_LONGEST_JUMP, None], width, axis=1)
    far, near = jumped
    for far_up, up, straight, down, far_down, further in zip(*(rows[:-1] for rows in moved), sums[1:], strict=True):
        # Either way costs the same: the cheaper of the two is taken before the price is added.
        np.minimum(far_up, far_down, out=far)
        np.minimum(up, down, out=near)
        np.add(jumped, added, out=jumped)
        np.minimum(far, near, out=near)
        np.minimum(near, straight, out=near)
        np.add(further, near, out=further)
    reached = np.empty((len(moved), half, width), np.float32)
    for rows, price, out in zip(moved, prices, reached, strict=True):
        np.add(rows, price, out=out)
    join = reached[:, -1, :steps]
    meeting = int((join.min(axis=0) + sums[-1, other:]).argmin())
    ends = (int(join[:, meeting].argmin()) - _LONGEST_JUMP + meeting, meeting)
    # The first of the cheapest jumps at every place, as `argmin` over them finds it in three times as long.
    least, jumps = reached[0], np.zeros((half, width), np.uint8)
    for jump, rows in enumerate(reached[1:], 1):
        np.maximum(jumps, (rows < least).view(np.uint8) * np.uint8(jump), out=jumps)
        np.minimum(least, rows, out=least)
    # Bytes are read as plain integers, which a loop goes through much faster than through an array's scalars.
    taken = jumps.tobytes()
    paths: list[list[int]] = []
    for end, side in zip(ends, (0, other), strict=True):
        place, path = end, [end]
        for row in range((half - 2) * width + side, -1, -width):
            place += taken[row + place] - _LONGEST_JUMP
            path.append(place)
        paths.append(path)
    path = paths[0][::-1] + paths[1]
    # At its two ends the path is not bound to close: a quarter turn at either end is left out.
    start = rays // 4
    return np.array(path[rays : rays + start] + path[start:rays], np.intp)
