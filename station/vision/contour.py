"""The contact's edge: where the change falls off most steeply on rays from the contact's middle.

The change's length grows from the flat centre to the contact's edge and falls in the skirt of gel around it; the
steepest fall marks the edge. On each ray the length is first replaced by the largest further out, so that the fall
towards the flat centre is none. The steepest closed path over all rays that does not jump is found by dynamic
programming (Viterbi), twice: about the bending's middle and about the first path's.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.vision.contact import FloatImage, Mask

RAYS = 64
_STEPS = 64
_FIRST_SPAN = (0.3, 1.2)
_SECOND_SPAN = (0.6, 1.4)
_HIGHEST_HARMONIC = 3.0
_LONGEST_JUMP = 2
_STRONG_QUANTILE = 0.75
_LEAST_STEEPNESS = 0.4
_LEAST_FALL_LEVELS = 1e-3
_CHORD_SHARE, _CHORD_IN_CORNER = 0.65, 0.4
"""Of a region's extent along the border, from which on its middle is near that border, or that corner."""
_WHOLE_FALL, _WHOLE_AREA = 0.68, 0.55
"""An edge that lies in the image is the contact's own when it falls on the mean by this share of a strong fall, and
encloses more than this share of what the completed one does."""
_SIDE_SHARE = 0.15
_REACH_STEP_PX = 2

_Floats = npt.NDArray[np.float64]
_ANGLES = np.arange(RAYS) * (2 * np.pi / RAYS)
COSINES, SINES = np.cos(_ANGLES), np.sin(_ANGLES)


@dataclass(frozen=True, slots=True)
class Edge:
    """A closed edge and what the image shows across it."""

    points: _Floats
    """Shape (64, 2), x and y in pixels, some perhaps beyond the image's border."""
    seen: npt.NDArray[np.bool_]
    """Shape (64,): whether the point lies in the image."""
    drop_levels: _Floats
    """Shape (64,): by how much the change falls across the edge there, grey levels."""


def find_edge(length: FloatImage, region: Mask, middle: tuple[float, float], stiffness: float) -> Edge:
    """Find the edge of the contact in a region; a contact that the border cuts is completed by its mirror image.

    Args:
        length: length of the change over the channels, shape (height, width), grey levels.
        region: where the contact lies, skirt and all, shape (height, width), 0 or not.
        middle: x and y from which the region is star-shaped, px.
        stiffness: cost of a jump of one step between neighbouring rays, in units of a steep ray's fall.
    """
    edge = _closed_edge(length, region, middle, stiffness)
    left, top, right, bottom = _mirrored(region)
    if not (left or top or right or bottom):
        return edge
    height, width = length.shape
    sides = (top, bottom, left, right, cv2.BORDER_REFLECT_101)
    length = np.asarray(cv2.copyMakeBorder(length, *sides), np.float32)
    region = np.asarray(cv2.copyMakeBorder(region, *sides), np.uint8)
    moments = cv2.moments(region, binaryImage=True)
    middle = (moments["m10"] / moments["m00"], moments["m01"] / moments["m00"])
    completed = _closed_edge(length, region, middle, stiffness)
    points = completed.points - (left, top)
    completed = Edge(points, _in_image(points, height, width), completed.drop_levels)
    return edge if _is_whole(edge, completed, height, width) else completed


def _closed_edge(length: FloatImage, region: Mask, middle: tuple[float, float], stiffness: float) -> Edge:
    height, width = length.shape
    radius = _smooth(_reach(region, middle))
    radius, _ = _steepest(length, middle, radius, _FIRST_SPAN, stiffness)
    points = _points(middle, radius)
    moments = cv2.moments(points.astype(np.float32))
    if moments["m00"] > 0:
        centre = (
            float(np.clip(moments["m10"] / moments["m00"], 0, width - 1)),
            float(np.clip(moments["m01"] / moments["m00"], 0, height - 1)),
        )
        away = points - centre
        angle = np.arctan2(away[:, 1], away[:, 0])
        order = np.argsort(angle)
        again = np.interp(_ANGLES, angle[order], np.hypot(away[:, 0], away[:, 1])[order], period=2 * np.pi)
        middle, radius = centre, _smooth(again)
    radius, drop = _steepest(length, middle, radius, _SECOND_SPAN, stiffness)
    points = _points(middle, radius)
    return Edge(points, _in_image(points, height, width), drop)


def _in_image(points: _Floats, height: int, width: int) -> npt.NDArray[np.bool_]:
    return (points >= 0).all(axis=1) & (points[:, 0] <= width - 1) & (points[:, 1] <= height - 1)


def _is_whole(edge: Edge, completed: Edge, height: int, width: int) -> bool:
    """Whether an edge lies in the image and falls all around, so that the border cuts no more than the skirt.

    On the way to a cut contact's flat centre the change falls by less, or what falls is a part of the contact.
    """
    if not edge.seen.all():
        return False
    drops = (edge.drop_levels, completed.drop_levels[completed.seen])
    strong = float(np.quantile(np.concatenate(drops), _STRONG_QUANTILE))
    if np.clip(edge.drop_levels / max(strong, _LEAST_FALL_LEVELS), 0, 1).mean() < _WHOLE_FALL:
        return False
    return _area(edge.points, height, width) > _WHOLE_AREA * _area(completed.points, height, width)


def _area(points: _Floats, height: int, width: int) -> int:
    mask = np.zeros((height, width), np.uint8)
    return cv2.countNonZero(cv2.fillPoly(mask, [np.rint(points).astype(np.int32)], 1))


def _mirrored(region: Mask) -> tuple[int, int, int, int]:
    """By how much to continue the image beyond its left, upper, right and lower border with its mirror image, px.

    A contact with its middle near the border or beyond it shows part of its edge only, and the way to its flat centre
    falls like an edge. With its mirror image it is closed. One that reaches opposite borders fills the field instead.
    """
    _, _, width, height = cv2.boundingRect(region)
    sides = ((width, region[:, 0]), (height, region[0]), (width, region[:, -1]), (height, region[-1]))
    chords = np.array([np.count_nonzero(side) for _, side in sides]) / (height, width, height, width)
    if (np.minimum(chords, np.roll(chords, 2)) > 0).any():
        return 0, 0, 0, 0
    in_corner = np.maximum(np.roll(chords, 1), np.roll(chords, -1)) > _CHORD_IN_CORNER
    near = chords > np.where(in_corner, _CHORD_IN_CORNER, _CHORD_SHARE)
    left, top, right, bottom = (across if one else 0 for (across, _), one in zip(sides, near, strict=True))
    return left, top, right, bottom


def _points(middle: tuple[float, float], radius: _Floats) -> _Floats:
    return np.stack([middle[0] + COSINES * radius, middle[1] + SINES * radius], axis=1)


def _reach(region: Mask, middle: tuple[float, float]) -> _Floats:
    """How far the region reaches on each ray; beyond the border as far as it does elsewhere."""
    height, width = region.shape
    steps = np.arange(1.0, np.hypot(height, width), _REACH_STEP_PX)
    x, y = middle[0] + COSINES[:, None] * steps, middle[1] + SINES[:, None] * steps
    inside = (x >= -0.5) & (y >= -0.5) & (x <= width - 0.5) & (y <= height - 0.5)
    values = cv2.remap(
        region, x.astype(np.float32), y.astype(np.float32), cv2.INTER_NEAREST, None, cv2.BORDER_REPLICATE
    )
    reach = np.where((values > 0) & inside, steps, 2.0).max(axis=1)
    cut = reach >= np.where(inside, steps, 0).max(axis=1) - 1.5
    if cut.any() and not cut.all():
        reach[cut] = np.maximum(reach[cut], np.median(reach[~cut]))
    return reach


def _smooth(radius: _Floats) -> _Floats:
    spectrum = np.fft.rfft(radius)
    spectrum *= np.exp(-0.5 * (np.arange(spectrum.size) / _HIGHEST_HARMONIC) ** 2)
    return np.maximum(np.fft.irfft(spectrum, RAYS), 1.0)


def _steepest(
    length: FloatImage, middle: tuple[float, float], radius: _Floats, span: tuple[float, float], stiffness: float
) -> tuple[_Floats, _Floats]:
    """The radius of the steepest path and the drop across it, per ray."""
    height, width = length.shape
    shares = np.linspace(*span, _STEPS)
    away = radius[:, None] * shares
    x, y = middle[0] + COSINES[:, None] * away, middle[1] + SINES[:, None] * away
    profile = cv2.remap(
        length, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE
    )
    profile = np.maximum.accumulate(profile[:, ::-1], axis=1)[:, ::-1]
    fall = np.zeros_like(profile)
    np.subtract(profile[:, :-2], profile[:, 2:], out=fall[:, 1:-1])
    fall[(x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)] = 0
    steepest = np.sort(fall.max(axis=1))
    steepest = steepest[steepest > 0]
    strong = steepest[int(_STRONG_QUANTILE * (steepest.size - 1))] if steepest.size else 1.0
    reward = np.maximum(np.minimum(fall * (1 / strong), 1) - _LEAST_STEEPNESS, 0) * (1 / (1 - _LEAST_STEEPNESS))
    path = closed_path(-reward, stiffness)
    side = max(1, round(_SIDE_SHARE / (shares[1] - shares[0])))
    rays = np.arange(RAYS)
    drop = profile[rays, np.maximum(path - side, 0)] - profile[rays, np.minimum(path + side, _STEPS - 1)]
    return radius * shares[path], drop.astype(np.float64)


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
    turns = np.concatenate([cost, cost[: rays // 2]]).astype(np.float32)
    half = len(turns) // 2
    between = np.full((half, _LONGEST_JUMP), np.inf, np.float32)
    both = np.concatenate([turns[:half], between, turns[: half - 1 : -1]], axis=1)
    other, width = steps + _LONGEST_JUMP, both.shape[1]
    price = (stiffness * np.arange(-_LONGEST_JUMP, _LONGEST_JUMP + 1, dtype=np.float32) ** 2)[:, None]
    padded = np.full(width + 2 * _LONGEST_JUMP, np.inf, np.float32)
    windows = np.lib.stride_tricks.sliding_window_view(padded, width)
    inner = padded[_LONGEST_JUMP:-_LONGEST_JUMP]
    inner[:] = both[0]
    jumped = np.empty((half - 1, len(price), width), np.float32)
    for reached, further in zip(jumped, both[1:], strict=True):
        np.add(windows, price, out=reached)
        np.minimum.reduce(reached, axis=0, out=inner)
        np.add(inner, further, out=inner)
    join = windows[:, :steps] + price
    meeting = int((join.min(axis=0) + inner[other:]).argmin())
    ends = (meeting + int(join[:, meeting].argmin()) - _LONGEST_JUMP, meeting)
    path = np.empty(len(turns), np.intp)
    for side, end in enumerate(ends):
        place = end
        for index in range(half - 1, 0, -1):
            path[index if side == 0 else len(turns) - 1 - index] = place
            place += int(jumped[index - 1, :, place + side * other].argmin()) - _LONGEST_JUMP
        path[-side] = place
    start = rays // 4
    return np.roll(path[start : start + rays], start)
