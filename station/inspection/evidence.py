"""Evidence of a press in numbers: areas at given closings, the growth, and where the curve does not rise.

Every number is computed twice: as an upper bound from all points, and as a lower bound from trusted points alone.
The upper bound decides against a PASS, the lower bound proves a FAIL.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from math import hypot
from statistics import median

from station.inspection.monotone import wrong_frames
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import SizedLimits
from station.inspection.uncertainty import Budget, budget_at
from station.vocabulary import Flag

LIGHT_TOUCH = 0.5
"""Below this share of the first damage threshold's closing a contact is too light to say anything for or against: a
seed is outlined in place of the contact (docs/robust.md, limits)."""

AT_MM = 0.03
"""So little short of a damage threshold's closing, a step is at it: eight counts of the gripper are 2.996 mm.
An area at its growth limit changes by 1.2 mm² over this, a quarter of what repeating an image changes it by."""

_WINDOW_POINTS = 4
"""The fewest of which the median of the pairwise slopes bears a wrong one, if it is not the first or the last."""
_WINDOW_MM = 2.0
LOWER_BOUNDS = {Flag.CUT_BY_BORDER, Flag.LOWER_BOUND}
"""Flags of an area that the contact surely reaches."""
EXCUSABLE = {Flag.LOW_CONFIDENCE, Flag.LOWER_BOUND}
"""Doubts about a step that a later, trusted one settles."""
_LEAST_NOISE = 0.02
"""Share of the largest area threshold below which a falling area is noise."""


@dataclass(frozen=True, slots=True)
class Growth:
    """The growth of the area over a few steps."""

    mm2_per_mm: float
    uncertainty_mm2_per_mm: float
    from_closing_mm: float
    to_closing_mm: float
    few: bool
    """Over fewer steps than show it well: it may prove, and is no ground for doubt."""
    trusted: bool
    """It is at least a lower bound: every point in it is trusted, and no area before the last is one whose edge was
    lost, from which the growth would seem larger than it is."""

    @property
    def least_mm2_per_mm(self) -> float:
        """Lower bound of the growth, mm² per mm: the value less its uncertainty."""
        return self.mm2_per_mm - self.uncertainty_mm2_per_mm

    @property
    def most_mm2_per_mm(self) -> float:
        """Upper bound of the growth, mm² per mm: the value plus its uncertainty."""
        return self.mm2_per_mm + self.uncertainty_mm2_per_mm


class Evidence:
    """A press in the order of its closing, beside the limits for its fruit."""

    def __init__(self, press: Press, limits: SizedLimits) -> None:
        self._press, self._limits = press, limits
        recipe = self._recipe = limits.recipe
        named_mm = [threshold.closing_mm for threshold in recipe.damage.area]
        self.points = _in_order([_at(point, named_mm) for point in press.points])
        self._budgets: dict[float, Budget] = {}

    @property
    def reached_mm(self) -> float:
        """The largest closing measured; 0 where none was."""
        return self.points[-1].closing_mm if self.points else 0.0

    @property
    def judged_from_mm(self) -> float:
        """The closing from which the curve says something."""
        return LIGHT_TOUCH * self._recipe.damage.area[0].closing_mm

    @cached_property
    def judged(self) -> list[Measured]:
        """All points but those of light touches."""
        return [point for point in self.points if point.closing_mm >= self.judged_from_mm]

    @cached_property
    def needed(self) -> list[Measured]:
        """The judged points up to the first that reaches the last damage threshold's closing."""
        last_mm = self._recipe.damage.area[-1].closing_mm
        before = [point for point in self.judged if point.closing_mm < last_mm]
        return self.judged[: len(before) + 1]

    @cached_property
    def excused(self) -> list[Measured]:
        """Needed points that a PASS does without, since their confidence is too small or their edge was lost.

        The area rises with the closing: where the last needed point is trusted and within its limit, every earlier
        area is smaller, also where its image shows another one. An earlier limit is then judged by what was measured
        there, trusted or not. Such a point may spoil the onset; the other points are checked for that too.
        """
        if not self.needed:
            return []
        last, threshold = self.needed[-1], self._recipe.damage.area[-1]
        kept = last.area_mm2 + self._uncertainty_mm2(last) <= threshold.area_mm2
        if last.closing_mm < threshold.closing_mm or not kept or self.doubts(last) or last in self.falling:
            return []
        return [point for point in self.needed if self.doubts(point) and self.doubts(point) <= EXCUSABLE]

    def bounds(self, point: Measured) -> bool:
        """Return whether the area is surely no larger than the contact: an edge cut or lost makes it smaller."""
        return self.doubts(point) <= LOWER_BOUNDS and point not in self.falling

    def doubts(self, point: Measured) -> frozenset[Flag]:
        """The point's flags, with those that follow from its values."""
        doubts = set(point.flags)
        if point.confidence is None or point.confidence < self._recipe.segmentation.robust.least_confidence:
            doubts.add(Flag.LOW_CONFIDENCE)
        # The area of an undecided image is unknown and only given as 0.
        if point.area_mm2 == 0 and Flag.UNDECIDED not in doubts:
            doubts.add(Flag.NO_CONTACT)
        return frozenset(doubts)

    @cached_property
    def falling(self) -> list[Measured]:
        """Judged points whose area does not fit a closing gripper."""
        areas = [point.area_mm2 for point in self.judged]
        least_noise = _LEAST_NOISE * self._recipe.damage.area[-1].area_mm2
        # `wrong_frames` takes widths, which fall while the closing rises.
        widths = [-point.closing_mm for point in self.judged]
        return [self.judged[wrong.index] for wrong in wrong_frames(widths, areas, least_noise=least_noise)]

    def area_at(self, closing_mm: float) -> tuple[float, float] | None:
        """Area and expanded uncertainty, mm², between the points around a closing above 0; None if not reached."""
        found = _between(self.points, closing_mm)
        return None if found is None else self._with_uncertainty(closing_mm, *found)

    def budget_at(self, closing_mm: float) -> Budget:
        """Return the uncertainty budget of an area at a closing above 0."""
        if closing_mm not in self._budgets:  # each is asked for by all that is judged of one closing
            self._budgets[closing_mm] = budget_at(closing_mm, self._press, self._limits)
        return self._budgets[closing_mm]

    def _with_uncertainty(self, closing_mm: float, area_mm2: float, scatter_mm2: float) -> tuple[float, float]:
        # What steps of one closing differ by was seen, so the uncertainty is no less.
        return area_mm2, max(area_mm2 * self.budget_at(closing_mm).expanded, scatter_mm2)

    def _uncertainty_mm2(self, point: Measured) -> float:
        """Expanded, of a judged point's area."""
        return self._with_uncertainty(point.closing_mm, point.area_mm2, point.area_scatter_mm2)[1]

    def least_area_mm2(self, closing_mm: float) -> float | None:
        """The area that is surely reached at a closing; None where nothing trusted was measured up to it.

        The first contact was seen too late, by half of the onset's interval on the average: a true closing is that much
        more than the measured one, so the area is looked for that much sooner; how far it may differ from the average
        is in the budget. Beyond the last trusted point the area is at least that point's, since it rises.
        """
        place_mm = closing_mm - (self._press.onset_uncertainty_mm or 0.0) / 2
        for before, after in pairwise(self.judged):
            if before.closing_mm <= place_mm <= after.closing_mm and self.bounds(before) and self.bounds(after):
                found = _between((before, after), place_mm) or (0.0, 0.0)
                area, uncertainty = self._with_uncertainty(place_mm, *found)
                return area - uncertainty
        trusted = [point for point in self.judged if point.closing_mm <= place_mm and self.bounds(point)]
        return trusted[-1].area_mm2 - self._uncertainty_mm2(trusted[-1]) if trusted else None

    @cached_property
    def growths(self) -> list[Growth]:
        """The growth over every run of judged steps; over all of them where they are too few for a run."""
        return [self._growth(window) for window in self._windows(self.judged)]

    @property
    def latest_growth(self) -> Growth | None:
        """The growth over the last steps, light touches too; None before there are enough."""
        windows = self._windows([point for point in self.points if point.closing_mm >= 0])
        return self._growth(windows[-1]) if windows and len(windows[-1]) >= _WINDOW_POINTS else None

    @property
    def begins_at_mm(self) -> float | None:
        """Closing at which the line through the needed points has no area; None without such a line.

        Where points are excused, the trusted ones have to show it too, with the first beyond the needed ones: the later
        of both begins.
        """
        begins = [self._begins_at_mm(self.needed)]
        if self.excused:
            beyond = [point for point in self.judged if point not in self.needed and self.bounds(point)]
            begins.append(self._begins_at_mm([*(point for point in self.needed if self.bounds(point)), *beyond[:1]]))
        return None if None in begins else max(begin for begin in begins if begin is not None)

    def _windows(self, points: Sequence[Measured]) -> list[Sequence[Measured]]:
        """Runs of at least four points and two millimetres; without one all points, if they are not of one count."""
        windows: list[Sequence[Measured]] = []
        for end in range(len(points), 0, -1):
            start = end - _WINDOW_POINTS
            while start > 0 and points[end - 1].closing_mm - points[start].closing_mm < _WINDOW_MM:
                start -= 1
            if start < 0:
                break
            windows.append(points[start:end])
        return windows[::-1] or ([points] if self._shows_slope(points) else [])

    def _shows_slope(self, points: Sequence[Measured]) -> bool:
        """Return whether points, in the order of their closing, are not all of one count of the gripper."""
        # The width of an image on the way is interpolated: two of one count may be that count apart and read as a few
        # hundredths of a millimetre, over which a slope may have any value.
        return bool(points) and points[-1].closing_mm - points[0].closing_mm > self._press.resolution_mm / 2

    def _begins_at_mm(self, points: Sequence[Measured]) -> float | None:
        # Medians, as for the growth: of five points or more a single wrong one hardly moves them.
        slope = median(_slopes(points)) if self._shows_slope(points) else 0.0
        return median(point.closing_mm - point.area_mm2 / slope for point in points) if slope > 0 else None

    def _step_uncertainty_mm2(self, point: Measured) -> float:
        """Of a point's area against its neighbours'; what they share shifts them alike."""
        if point.closing_mm <= 0:  # the light touch of the onset
            return point.area_scatter_mm2
        share = self.budget_at(point.closing_mm).expanded_of("repeatability", "gripper")
        return max(point.area_mm2 * share, point.area_scatter_mm2)

    def _growth(self, window: Sequence[Measured]) -> Growth:
        """Theil and Sen's slope, with the uncertainty of a fitted line through points equally uncertain.

        What an uncertain scale and size make of it comes on top.
        Sen, Journal of the American Statistical Association 63 (1968) 1379.
        """
        slope = median(_slopes(window))
        middle_mm = sum(point.closing_mm for point in window) / len(window)
        spread_mm = sum((point.closing_mm - middle_mm) ** 2 for point in window) ** 0.5
        # The largest, since the line's formula takes all points as equally uncertain.
        of_points = max(self._step_uncertainty_mm2(point) for point in window) / spread_mm
        of_scale = abs(slope) * self.budget_at(_WINDOW_MM).expanded_of("scale", "size")  # at any closing alike
        uncertainty = hypot(of_points, of_scale)
        # What the border cuts off grows too, so a difference of cut areas is a lower bound of the growth. An edge that
        # was lost may be found again: the difference from its area would count what was there before as growth.
        lost = any(Flag.LOWER_BOUND in point.flags for point in window[:-1])
        trusted = not lost and all(self.bounds(point) for point in window)
        few = len(window) < _WINDOW_POINTS or window[-1].closing_mm - window[0].closing_mm < _WINDOW_MM
        return Growth(slope, uncertainty, window[0].closing_mm, window[-1].closing_mm, few, trusted)


def _at(point: Measured, named_mm: Sequence[float]) -> Measured:
    for closing_mm in named_mm:
        if 0 <= closing_mm - point.closing_mm <= AT_MM:
            return replace(point, closing_mm=closing_mm)
    return point


def _in_order(points: Sequence[Measured]) -> list[Measured]:
    """The points by closing, with those of one closing made one: the gripper has counts, so two steps may share it."""
    ordered = sorted(points, key=lambda point: point.closing_mm)
    return [_one(list(group)) for _, group in groupby(ordered, key=lambda point: point.closing_mm)]


def _one(points: list[Measured]) -> Measured:
    """One point for several of one closing: the largest area, the least trust."""
    areas = [point.area_mm2 for point in points]
    largest = max(points, key=lambda point: (point.area_mm2, point.area_px))
    confidences = [point.confidence for point in points]
    return replace(
        largest,
        area_scatter_mm2=max(areas) - min(areas),
        confidence=None if None in confidences else min(c for c in confidences if c is not None),
        flags=frozenset[Flag]().union(*(point.flags for point in points)),
    )


def _between(points: Sequence[Measured], closing_mm: float) -> tuple[float, float] | None:
    """Area and scatter, mm²."""
    for point in points:
        if point.closing_mm == closing_mm:
            return point.area_mm2, point.area_scatter_mm2
    for before, after in pairwise(points):
        if before.closing_mm < closing_mm < after.closing_mm:
            share = (closing_mm - before.closing_mm) / (after.closing_mm - before.closing_mm)
            area = before.area_mm2 + share * (after.area_mm2 - before.area_mm2)
            return area, max(before.area_scatter_mm2, after.area_scatter_mm2)
    return None


def _slopes(points: Sequence[Measured]) -> list[float]:
    """Between every two points, mm²/mm."""
    return [
        (after.area_mm2 - before.area_mm2) / (after.closing_mm - before.closing_mm)
        for place, before in enumerate(points)
        for after in points[place + 1 :]
    ]
