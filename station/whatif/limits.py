"""Limits from fruit marked good and bad: the limit of least cost, and its uncertainty.

Each fruit is one number: the least limit, for a fruit of the reference length, by which the judge would pass it. So a
limit's two errors on the marked fruit are counts, and no distribution of the fruit is assumed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from station.binomial import clopper_pearson
from station.inspection.evidence import Evidence
from station.inspection.judge import early_stop, judge
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.settings.damage import LARGEST_AREA_MM2, LARGEST_GROWTH_MM2_PER_MM
from station.settings.recipe_model import Recipe

Values = npt.NDArray[np.float64]
Counts = npt.NDArray[np.intp]
_Shares = TypeVar("_Shares", float, Values)

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Costs:
    """Costs of the line's errors."""

    false_accept: float
    """Cost of a false accept, in units of one false reject."""
    damaged_share: float
    """Share of damaged fruit on the line, above 0 and below 1."""

    def of(self, false_accepts: _Shares, false_rejects: _Shares) -> _Shares:
        """Return the cost of an average fruit, in false rejects, by the shares of damaged and sound fruit in error."""
        return self.damaged_share * self.false_accept * false_accepts + (1 - self.damaged_share) * false_rejects


@dataclass(frozen=True, slots=True)
class MarkedFruit:
    """A marked fruit's constraint on the limit at a closing."""

    good: bool
    passes_from_mm2: float
    """The least limit by which it passes, at its own size; infinite if none does that a recipe may have."""
    area_mm2: float | None
    """The area itself; None if the closing was not reached."""
    length_mm: float | None
    """The length that its limits are for; None if the recipe does not use the size, or it is not known."""
    at_least: bool = False
    """The judge ended its steps before the closing: the limit is this or a larger one."""


@dataclass(frozen=True, slots=True)
class Interval:
    """Confidence interval of a value, at `CONFIDENCE`; None if there are too few fruit."""

    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Exponent:
    """Exponent of the area in the length, from the marked fruit."""

    value: float
    standard_error: float
    fruit: int


def marked_fruit(press: Press, recipe: Recipe, closing_mm: float, *, good: bool, draft: Recipe) -> MarkedFruit | None:
    """Return a press's constraint on the limit at a closing; None if a fault ended it before, or it touched nothing.

    A press that the judge rejects for other reasons than a limit is diverted by every limit. A fruit whose steps the
    judge ended before has at least the measured area; leaving out the worst of the bad fruit would be wrong. Of these,
    a good one counts as diverted, a bad one as passed by any larger limit, the less favourable case, unless an earlier
    limit or the growth, unchanged in the draft, has proven it damaged or lets it pass no more.

    Args:
        recipe: that it was pressed by, whose early stop may have ended its steps.
        draft: the recipe that the limit is proposed for: its size rule, and its guard band.
    """
    limits = sized_limits(press, draft)
    evidence = Evidence(press, limits)
    if press.interruptions or not evidence.points:
        return None
    area = evidence.area_at(closing_mm)
    if area is not None:
        passes = judge(press, _with_largest_limits(draft, closing_mm)).outcome == "PASS"
        return MarkedFruit(good, sum(area) if passes else math.inf, area[0], limits.length_mm)
    if early_stop(press, recipe) is None:
        return None
    verdict = judge(press, _with_open_limit(draft, closing_mm))
    # Without a finding it is not the early stop that ended the steps, which a draft may raise.
    cannot_pass = verdict.outcome != "PASS" and verdict.stopped is not None and verdict.stopped.finding is None
    if verdict.outcome == "FAIL" or cannot_pass:
        return MarkedFruit(good, math.inf, None, limits.length_mm)
    known = [point.area_mm2 for point in evidence.judged if evidence.bounds(point)]
    at_least = max(known) if known and not good else math.inf
    return MarkedFruit(good, at_least, None, limits.length_mm, at_least=True)


def exponent_of(fruit: Sequence[MarkedFruit]) -> Exponent | None:
    """Fit the exponent of the area in the length: one slope for good and bad fruit, each with its own level.

    An area by which no limit passes the fruit is left out, since it is not trusted: the border cuts the large ones.

    Returns:
        None with fewer than four fruit of known length and trusted area, or all of one length.
    """
    trusted = [one for one in fruit if math.isfinite(one.passes_from_mm2)]
    known = [(one.good, one.length_mm, one.area_mm2) for one in trusted if one.length_mm and one.area_mm2]
    if len(known) < 4:
        return None
    good = np.array([each[0] for each in known])
    lengths, areas = (np.log(np.array([each[column] for each in known])) for column in (1, 2))
    for group in (good, ~good):
        if group.any():
            lengths[group] -= lengths[group].mean()
            areas[group] -= areas[group].mean()
    spread = float(lengths @ lengths)
    # One slope, and a level for each kind, are fitted.
    freedom = len(known) - 1 - len(set(good.tolist()))
    if spread < 1e-9 or freedom < 1:
        return None
    slope = float(lengths @ areas) / spread
    left = areas - slope * lengths
    return Exponent(slope, math.sqrt(float(left @ left) / freedom / spread), len(known))


def at_reference(fruit: Sequence[MarkedFruit], exponent: float, reference_mm: float) -> tuple[Values, Values]:
    """Return the least limits, mm², by which fruit pass, converted to the reference length of the recipe's limits.

    Returns:
        Of the good, and of the bad, each in the order given.
    """
    factors = [(reference_mm / one.length_mm) ** exponent if one.length_mm else 1.0 for one in fruit]
    good, bad = (
        np.array(
            [one.passes_from_mm2 * factor for one, factor in zip(fruit, factors, strict=True) if one.good == wanted]
        )
        for wanted in (True, False)
    )
    return good, bad


def errors(good: Values, bad: Values, limits: Values) -> tuple[Counts, Counts]:
    """Count the good fruit that each limit diverts, and the bad ones that it passes; `good` and `bad` as `choose`."""
    # By "right" a fruit passes by its own value: the judge passes an area that meets its limit exactly.
    diverted = len(good) - np.searchsorted(np.sort(good), limits, side="right")
    return diverted, np.searchsorted(np.sort(bad), limits, side="right")


def choose(good: Values, bad: Values, costs: Costs) -> float:
    """Return the limit of the least cost on the marked fruit; of equal ones, the middle of the widest gap.

    Args:
        good: least limits by which they pass, mm²; at least one of them finite.
        bad: likewise; at least one.
    """
    steps, _ = _steps(good, bad)
    diverted, passed = errors(good, bad, steps)
    cost = costs.of(passed / len(bad), diverted / len(good))
    return float(_cheapest(steps, cost[None], np.ones(len(steps), dtype=np.bool_))[0])


def cross_validated(good: Values, bad: Values, costs: Costs) -> tuple[int, int] | None:
    """Count errors on fruit that the limit was not chosen on: each is left out once, and judged by the others' limit.

    Returns:
        Good fruit diverted and bad ones passed; None with too few to leave one out.
    """
    if np.isfinite(good).sum() < 2 or len(bad) < 2:
        return None
    steps, copies = _steps(good, bad)
    diverted, passed = errors(good, bad, steps)
    # One row for each fruit left out: it is not counted, and its own value is a limit only where another fruit has it.
    left_good, left_bad = good[:, None], bad[:, None]
    without_good = costs.of(passed / len(bad), (diverted - (left_good > steps)) / (len(good) - 1))
    without_bad = costs.of((passed - (left_bad <= steps)) / (len(bad) - 1), diverted / len(good))
    others_good = _cheapest(steps, without_good, (copies > 1) | (left_good != steps))
    others_bad = _cheapest(steps, without_bad, (copies > 1) | (left_bad != steps))
    return int((good > others_good).sum()), int((bad <= others_bad).sum())


def _steps(good: Values, bad: Values) -> tuple[Values, Counts]:
    """Return the limits at which an error changes, ascending, and how many fruit have each."""
    steps, copies = np.unique(np.concatenate([good, bad]), return_counts=True)
    finite = np.isfinite(steps)
    return steps[finite], copies[finite]


def _cheapest(steps: Values, cost: Values, there: npt.NDArray[np.bool_]) -> Values:
    """Return for each row of costs the limit of the least; of equal ones, the middle of the widest gap.

    Args:
        cost: of each step, shape (rows, steps).
        there: whether a row has the step, shape (rows, steps) or (steps).
    """
    cost = np.where(there, cost, np.inf)
    # A limit anywhere from one value to the next errs alike. Beyond the last nothing is known.
    # A gap ends at the next step that the row has, which is the least of all that follow.
    after = np.minimum.accumulate(np.where(np.isfinite(cost), steps, np.inf)[:, :0:-1], axis=1)[:, ::-1]
    ends = np.column_stack([after, np.full(len(cost), np.inf)])
    ends = np.where(np.isfinite(ends), ends, steps)
    # Equal costs may differ by rounding.
    cheap = cost <= cost.min(axis=1, keepdims=True) + 1e-12
    # A gap's width is a ratio, and its middle the geometric mean, as areas differ by shares.
    widest = np.where(cheap, ends / steps, 0.0).argmax(axis=1)
    low, high = steps[widest], ends[np.arange(len(cost)), widest]
    # Rounding must not take the limit below the value that it includes.
    return np.maximum(low, np.sqrt(low * high))


def rate_interval(happened: int, number: int) -> Interval:
    """Return the confidence interval of the rate of cases in trials."""
    return Interval(*clopper_pearson(happened, number)) if number else Interval(None, None)


def fewest_fruit(rate: float) -> int:
    """Return the number of fruit without an error that shows an error rate of at most `rate`, between 0 and 1."""
    # Without an error the two-sided interval of Clopper and Pearson ends at 1 - 0.025^(1/n).
    return math.ceil(math.log((1 - CONFIDENCE) / 2) / math.log(1 - rate))


def least_area_at(recipe: Recipe, closing_mm: float) -> float:
    """Return the least area of a recipe at any closing, mm², for a fruit of the reference length.

    The area goes with the closing, so it is on the line from one limit's to the next, before the first from no area at
    the onset. Beyond the last it stays: how the area rises there is not known, and it is no smaller.
    """
    limits = recipe.damage.area
    closings, areas = [each.closing_mm for each in limits], [each.least_area_mm2 for each in limits]
    return float(np.interp(closing_mm, [0.0, *closings], [0.0, *areas]))


def _with_open_limit(recipe: Recipe, closing_mm: float) -> Recipe:
    """Return the recipe with its earlier limits and growth, and an area at a closing that nothing is over.

    It stops where the outcome is decided, so that the verdict states it.
    """
    open_limit = {"closing_mm": closing_mm, "area_mm2": LARGEST_AREA_MM2}
    earlier = [each for each in recipe.damage.area if each.closing_mm < closing_mm]
    area = (*earlier, recipe.damage.area[-1].model_copy(update=open_limit))
    damage: dict[str, object] = {"area": area}
    if recipe.damage.decided_by == "every_limit":  # what one limit keeps from passing, all of them together do not pass
        damage["decided_by"] = "every_trusted"
    return recipe.model_copy(
        update={
            "damage": recipe.damage.model_copy(update=damage),
            "steps": recipe.steps.model_copy(update={"stop_when_decided": True}),
        }
    )


def _with_largest_limits(recipe: Recipe, closing_mm: float) -> Recipe:
    """Return the recipe with the largest limits that one may have, for the area at one closing only."""
    one = {
        "closing_mm": closing_mm,
        "area_mm2": LARGEST_AREA_MM2,
        "least_area_mm2": least_area_at(recipe, closing_mm),
    }
    area = (recipe.damage.area[-1].model_copy(update=one),)
    damage = {"area": area, "growth_mm2_per_mm": LARGEST_GROWTH_MM2_PER_MM}
    stop = {"area_mm2": LARGEST_AREA_MM2, "growth_mm2_per_mm": LARGEST_GROWTH_MM2_PER_MM}
    return recipe.model_copy(
        update={
            "damage": recipe.damage.model_copy(update=damage),
            "early_stop": recipe.early_stop.model_copy(update=stop),
            "steps": recipe.steps.model_copy(update={"stop_when_decided": True}),
        }
    )
