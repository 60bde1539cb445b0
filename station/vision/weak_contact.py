"""Weak-contact detector: a matched filter for touches that stay below the detection threshold of the curvature.

A weak contact changes the light by a grey level or two over a millimetre, less than it drifts. But the light drifts in
bands along the columns and slowly down them, gains, and moves its pattern: each column less its lowest cosines and a
parabola, and less what the reference turns into with a gain or a shift, is left with the touch and noise. What is left
is correlated with the slopes of a small round dent, in both directions and each colour, and counted in units of its own
spread over the frame, the colours' common noise taken apart (a matched filter; S. M. Kay, Fundamentals of Statistical
Signal Processing, volume 2, sections 4.3 and 4.4). Of noise the root of the sum of the six squares nearly follows the
chi distribution with six degrees of freedom, independent of the sensor's noise.
"""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.settings.segmentation import RobustParameters
from station.vision.constants import NORMAL_OF_MEDIAN, Constants
from station.vision.contact import FloatImage, Mask
from station.vision.working import LONG_SIDE_PX, NEXT_TO_NOTHING, length_squared

_REACH = 3.5
"""Standard deviations of the dent to which its filter reaches. Resolution: beyond is 0.05 % of it."""
_COSINES_DOWN = 7
"""With a parabola, since drift may slope at the border where cosines are level."""
_LEVELS, _MOST_CUT_OFF = (12.0, 224.0), 0.05
"""Beyond these noise and drift reach the ends of the scale, where drift has edges; and how much of a column may be."""
_PATTERN_SIGMA_PX = 2.0
"""The reference's own noise must not pass for its pattern: the change has the same noise."""
_WINSORISED, _RIDGE = 2.0, 0.05
"""Standard deviations at which noise is cut off before the colours' correlation is counted, and how much of that is not
believed."""
_EVERY, _BORDER_PX = 2, 8
"""Noise is counted at every second place, away from the border, where there is less of it."""
_LEAST_VALID, _RIM_PX = 0.5, 9
"""Where the reference is valid in less of a region it says nothing; and the rim whose slopes count as the region's."""
_LARGE_SHARE = 0.1
"""Share of the frame from which a region is large: then its own slopes raise the compression ratio, and no codec."""


class WeakResponse(NamedTuple):
    """The matched filter's response to one frame."""

    field: FloatImage
    """How far the slopes stand out of the noise, shape (height, width): the chi distribution's six degrees of freedom
    are two of each lit colour. 0 where the reference is not valid, at an end of the scale or under debris."""
    compression: float
    """By how much a codec's blocks make the noise's tails longer, 1 where there is none: thresholds rise by it."""


class WeakContactDetector:
    """The matched filter, prepared for a reference.

    Args:
        reference: mean of the untouched gel's frames at half the working size, shape (height, width, 3),
            grey levels.
        lit: which colours have light, shape (3,); the others are left out.
        clean: where there is no debris, shape (height, width), 0 or 1.
        constants: the dent's size and the threshold.
        gate_ratio: the recipe's.
    """

    def __init__(
        self,
        reference: FloatImage,
        lit: npt.NDArray[np.bool_],
        clean: FloatImage,
        constants: Constants,
        gate_ratio: float,
    ) -> None:
        height, width = clean.shape
        # A higher ratio than the default raises them; a lower one does not lower them: noise would reach them.
        self.threshold = constants.weak_threshold * max(1.0, gate_ratio / RobustParameters().gate_ratio)
        """What the response has to reach."""
        self._most_of_fine = constants.weak_most_of_fine
        self._reference, self._lit = reference, lit.astype(np.float32)
        # The dent that is looked for, 0.27 mm, is what the curvature's smoothing leaves of a point.
        # An image below the working size is not enlarged: the dent has fewer pixels there.
        sigma_px = constants.curvature_blur / 2 * min(1.0, max(height, width) / (LONG_SIDE_PX / 2))
        self._reach_px = int(np.ceil(_REACH * sigma_px))
        x = np.arange(-self._reach_px, self._reach_px + 1, dtype=np.float32)
        dent = np.exp(-np.square(x / sigma_px) / 2)
        self._dent, self._slope = dent / dent.sum(), -x * dent / dent.sum()
        cut_off = (((reference < _LEVELS[0]) | (reference > _LEVELS[1])) & lit).any(axis=2)
        # Cosines are fitted to whole columns: a few places that are cut off bend the rest of theirs.
        blind = (cut_off | (cut_off.mean(axis=0) > _MOST_CUT_OFF) | (clean == 0)).astype(np.uint8)
        side = 2 * self._reach_px + 1
        around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
        # A blind place spoils the response wherever the filter reaches it.
        self._valid = (cv2.dilate(blind, around) == 0).astype(np.float32)
        down = ((np.arange(height) + 0.5) / height - 0.5)[:, None]
        orders = np.arange(min(_COSINES_DOWN, max(1, height // 4)))
        slow = [np.cos(np.pi * (down + 0.5) * orders), down, down**2]
        self._slow = np.linalg.qr(np.concatenate(slow, axis=1))[0].astype(np.float32)
        self._known = self._drifts_of(reference)

    def _drifts_of(self, reference: FloatImage) -> FloatImage:
        """Return the changes of the reference as its light gains or its pattern moves, per colour orthonormal.

        Returns:
            Shape (3, height x width, 5).
        """
        pattern = cv2.GaussianBlur(reference, (0, 0), _PATTERN_SIGMA_PX)
        across, down = (np.linspace(-1, 1, side, dtype=np.float32) for side in reference.shape[1::-1])
        moved = (cv2.Sobel(pattern, cv2.CV_32F, dx, dy) for dx, dy in ((1, 0), (0, 1)))
        known = [pattern, pattern * across[:, None], pattern * down[:, None, None], *moved]
        # Without their slow parts, as the change has lost its own before these are taken off it.
        left = np.stack([self._without_slow(np.asarray(one, np.float32)) for one in known], axis=-1)
        columns = left.reshape(-1, 3, len(known)).transpose(1, 0, 2)
        return np.asarray(np.linalg.qr(columns)[0], np.float32)

    def _without_slow(self, difference: FloatImage) -> FloatImage:
        lines = difference.reshape(len(difference), -1)
        left = (lines - self._slow @ (self._slow.T @ lines)).reshape(difference.shape)
        return np.asarray(left - cv2.reduce(left, 1, cv2.REDUCE_AVG), np.float32)

    def _without_known(self, left: FloatImage) -> FloatImage:
        colours = np.ascontiguousarray(left.reshape(-1, 3).T)[..., None]
        colours -= self._known @ (self._known.transpose(0, 2, 1) @ colours)
        return np.ascontiguousarray(colours[..., 0].T).reshape(left.shape)

    def response(self, frame: FloatImage) -> WeakResponse:
        """Compute how far the slopes stand out of the noise.

        Args:
            frame: at half the working size, shape (height, width, 3), grey levels.
        """
        left = self._without_known(self._without_slow((frame - self._reference) * self._lit))
        fine = _fine_noise(left)
        total = np.zeros(left.shape[:2], np.float32)
        of_fine: list[float] = []
        for across, down in ((self._slope, self._dent), (self._dent, self._slope)):
            # Zero beyond the border: a mirror image there made half of all false maxima.
            filtered = cv2.sepFilter2D(left, cv2.CV_32F, across, down, borderType=cv2.BORDER_CONSTANT)
            slopes = np.asarray(filtered, np.float32)
            spread = _spread(_inner(slopes))
            total += _in_units_of_noise(slopes, spread)
            of_fine += list(np.square(spread / fine)[self._lit > 0])
        # A codec removes the fine noise and leaves blocks, whose slopes have longer tails than noise of their size.
        compression = max(1.0, float(np.mean(of_fine)) / self._most_of_fine)
        return WeakResponse(np.sqrt(total) * self._valid, compression)

    def place(self, response: WeakResponse) -> tuple[int, int] | None:
        """Find where something touches: x and y, or None where nothing exceeds the noise."""
        _, strongest, _, (x, y) = cv2.minMaxLoc(response.field)
        return (x, y) if strongest > self.threshold * response.compression else None

    def near(self, place: tuple[int, int]) -> tuple[slice, slice]:
        """Rows and columns within the dent's reach of a place, x and y, px."""
        x, y = place
        reach_px = self._reach_px
        return slice(max(0, y - reach_px), y + reach_px + 1), slice(max(0, x - reach_px), x + reach_px + 1)

    def supports(self, region: Mask, response: WeakResponse) -> bool:
        """Return whether a region's slopes exceed noise and drift; True where too little of the reference is valid."""
        if np.mean(self._valid[region > 0]) < _LEAST_VALID:
            return True
        with_rim = cv2.dilate(region, np.ones((_RIM_PX, _RIM_PX), np.uint8)) > 0
        # A large contact's own slopes are what raises the ratio, and no codec.
        compression = response.compression if np.mean(region > 0) < _LARGE_SHARE else 1.0
        return float(response.field[with_rim].max()) > self.threshold * compression


def _inner(field: FloatImage) -> FloatImage:
    """Every second place away from the border, shape (places, 3)."""
    border_px = min(_BORDER_PX, min(field.shape[:2]) // 4)
    inner = slice(border_px, -border_px or None, _EVERY)
    return field[inner, inner].reshape(-1, 3)


def _spread(values: FloatImage) -> FloatImage:
    """Each colour's standard deviation by its median size, shape (3,): a contact takes little of the frame."""
    spread = NORMAL_OF_MEDIAN * np.median(np.abs(values), axis=0)
    return np.maximum(spread, NEXT_TO_NOTHING).astype(np.float32)


def _fine_noise(left: FloatImage) -> FloatImage:
    """Standard deviation of what changes from one place to the next in both directions, shape (3,).

    Of white noise it is the noise's own: the mixed second difference of four places, halved.
    """
    across = left[:, :-1] - left[:, 1:]
    return _spread(_inner(np.asarray((across[:-1] - across[1:]) / 2, np.float32)))


def _in_units_of_noise(slopes: FloatImage, spread: FloatImage) -> FloatImage:
    """The squared length of what the colours show, once their noise has the spread 1 and nothing in common.

    A contact takes little of the frame, and is cut off before the noise is counted.
    """
    noise = np.clip(_inner(slopes) / spread, -_WINSORISED, _WINSORISED)
    common = noise.T @ noise
    size = np.sqrt(np.maximum(common.diagonal(), NEXT_TO_NOTHING))
    # The ridge also makes the matrix regular where a colour has no light, and so no noise.
    common = (1 - _RIDGE) * common / np.outer(size, size) + _RIDGE * np.eye(3)
    apart = np.linalg.inv(np.linalg.cholesky(common)) / spread
    alone = cv2.transform(slopes, apart.astype(np.float32))
    return length_squared(np.asarray(alone, np.float32))
