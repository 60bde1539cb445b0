"""A limit from fruit that people found good and bad, for what either error costs, with what is unsure about it.

Each fruit is one number: the least limit, for a fruit of the reference length, by which the judge would pass it. So a
limit's two errors on the marked fruit are counts, and nothing is assumed of how fruit are distributed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from station.inspection.evidence import Evidence
from station.inspection.judge import early_stop, judge
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.settings.damage import LARGEST_AREA_MM2
from station.settings.recipe_model import Recipe

Values = npt.NDArray[np.float64]
Counts = npt.NDArray[np.intp]

CONFIDENCE = 0.95
_LARGEST_GROWTH_MM2_PER_MM = 500.0


@dataclass(frozen=True, slots=True)
class Costs:
    """What the line's errors cost."""

    false_accept: float
    """Of a damaged fruit that passes, in sound fruit that are diverted."""
    damaged_share: float
    """Of the line's fruit, above 0 and below 1: how often there is a damaged one to pass."""

    def of(self, false_accepts: float, false_rejects: float) -> float:
        """Of an average fruit of the line, in sound fruit that are diverted.

        Args:
            false_accepts: share of the damaged fruit that pass.
            false_rejects: share of the sound fruit that do not.
        """
        return self.damaged_share * self.false_accept * false_accepts + (1 - self.damaged_share) * false_rejects


@dataclass(frozen=True, slots=True)
class MarkedFruit:
    """What one marked fruit's press says about a limit at a closing."""

    good: bool
    passes_from_mm2: float
    """The least limit by which it passes, as its own size has it; infinite where none does."""
    area_mm2: float | None
    """The area itself; None where the closing was not reached."""
    length_mm: float | None
    """The length that its limits are for; None where the recipe does not go by the size, or it is not known."""
    at_least: bool = False
    """The judge ended its steps before the closing: the limit is this or a larger one."""


@dataclass(frozen=True, slots=True)
class Interval:
    """Where a value lies with `CONFIDENCE`; None where the fruit are too few to say."""

    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Exponent:
    """How the area goes with the length, as the marked fruit have it."""

    value: float
    standard_error: float
    fruit: int


def marked_fruit(press: Press, recipe: Recipe, closing_mm: float, *, good: bool) -> MarkedFruit | None:
    """What a press says about the limit at a closing; None where a fault ended it before, or it touched nothing.

    What the judge doubts for other reasons than a limit is diverted whatever the limit is. A fruit whose steps the
    judge ended before has at least the area that was measured; it would be wrong to leave out the worst of the bad.
    A good one of them is taken as diverted, a bad one as passed by any larger limit: the less favourable.

    Args:
        press: as stored.
        recipe: that it was pressed by.
        closing_mm: where the limit is looked for.
        good: how the fruit is marked.
    """
    limits = sized_limits(press, recipe)
    evidence = Evidence(press, limits)
    if press.interruptions or not evidence.points:
        return None
    area = evidence.area_at(closing_mm)
    if area is not None:
        passes = judge(press, _without_limits(recipe, closing_mm)).outcome == "PASS"
        return MarkedFruit(good, sum(area) if passes else math.inf, area[0], limits.length_mm)
    if early_stop(press, recipe) is None:
        return None
    known = [point.area_mm2 for point in evidence.judged if evidence.bounds(point)]
    at_least = max(known) if known and not good else math.inf
    return MarkedFruit(good, at_least, None, limits.length_mm, at_least=True)


def exponent_of(fruit: Sequence[MarkedFruit]) -> Exponent | None:
    """The exponent of the area in the length: one slope for good and bad fruit, each with a level of its own.

    Args:
        fruit: marked ones.

    Returns:
        None with fewer than four fruit of known length and area, or all of one length.
    """
    known = [(one.good, one.length_mm, one.area_mm2) for one in fruit if one.length_mm and one.area_mm2]
    if len(known) < 4:
        return None
    good = np.array([each[0] for each in known])
    lengths, areas = (np.log(np.array([each[column] for each in known])) for column in (1, 2))
    for group in (good, ~good):
        if group.any():
            lengths[group] -= lengths[group].mean()
            areas[group] -= areas[group].mean()
    spread = float(lengths @ lengths)
    freedom = len(known) - 1 - len(set(good.tolist()))
    if spread < 1e-9 or freedom < 1:
        return None
    slope = float(lengths @ areas) / spread
    left = areas - slope * lengths
    return Exponent(slope, math.sqrt(float(left @ left) / freedom / spread), len(known))


def at_reference(fruit: Sequence[MarkedFruit], exponent: float, reference_mm: float) -> tuple[Values, Values]:
    """The least limits by which fruit pass, for a fruit of the reference length.

    Args:
        fruit: marked ones.
        exponent: of the area in the length.
        reference_mm: for which a recipe's limits are written.

    Returns:
        Of the good, and of the bad, mm², each in the order given.
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
    """How many good fruit each limit diverts, and how many bad ones it passes.

    Args:
        good: least limits by which they pass, mm².
        bad: likewise.
        limits: to try, mm².
    """
    diverted = len(good) - np.searchsorted(np.sort(good), limits, side="right")
    return diverted, np.searchsorted(np.sort(bad), limits, side="right")


def choose(good: Values, bad: Values, costs: Costs) -> float:
    """The limit of the least cost on the marked fruit; of limits that cost the same, the middle of the widest gap.

    Args:
        good: least limits by which they pass, mm²; at least one of them finite.
        bad: likewise; at least one.
        costs: of the errors.
    """
    steps = np.unique(np.concatenate([good, bad]))
    steps = steps[np.isfinite(steps)]
    diverted, passed = errors(good, bad, steps)
    cost = np.array([costs.of(p / len(bad), d / len(good)) for p, d in zip(passed, diverted, strict=True)])
    # A limit anywhere from one value to the next errs alike. Beyond the last nothing is known.
    ends = np.append(steps[1:], steps[-1])
    cheapest = np.flatnonzero(cost <= cost.min() + 1e-12)
    widest = max(cheapest, key=lambda place: ends[place] / steps[place])
    return max(float(steps[widest]), math.sqrt(steps[widest] * ends[widest]))


def cross_validated(good: Values, bad: Values, costs: Costs) -> tuple[int, int] | None:
    """Errors on fruit that the limit was not chosen on: each is left out once, and judged by the limit of the others.

    Args:
        good: least limits by which they pass, mm².
        bad: likewise.
        costs: of the errors.

    Returns:
        Good fruit diverted and bad ones passed; None with too few to leave one out.
    """
    if np.isfinite(good).sum() < 2 or len(bad) < 2:
        return None
    diverted = sum(one > choose(np.delete(good, place), bad, costs) for place, one in enumerate(good))
    passed = sum(one <= choose(good, np.delete(bad, place), costs) for place, one in enumerate(bad))
    return int(diverted), int(passed)


def rate_interval(happened: int, number: int) -> Interval:
    """Where a rate lies (Clopper and Pearson, Biometrika 26 (1934) 404).

    Args:
        happened: how often.
        number: of how many.
    """
    if not number:
        return Interval(None, None)
    found = stats.binomtest(happened, number).proportion_ci(CONFIDENCE, method="exact")
    return Interval(float(found.low), float(found.high))


def fewest_fruit(rate: float) -> int:
    """How many fruit without an error show that no more than a rate of them err.

    Args:
        rate: above 0 and below 1.
    """
    return math.ceil(math.log((1 - CONFIDENCE) / 2) / math.log(1 - rate))


def _without_limits(recipe: Recipe, closing_mm: float) -> Recipe:
    """The recipe with nothing to fail a fruit whose measurement is trusted up to a closing."""
    last = recipe.damage.area[-1]
    area = (last.model_copy(update={"closing_mm": closing_mm, "area_mm2": LARGEST_AREA_MM2}),)
    damage = {"area": area, "growth_mm2_per_mm": _LARGEST_GROWTH_MM2_PER_MM}
    stop = {"area_mm2": LARGEST_AREA_MM2, "growth_mm2_per_mm": _LARGEST_GROWTH_MM2_PER_MM}
    return recipe.model_copy(
        update={
            "damage": recipe.damage.model_copy(update=damage),
            "early_stop": recipe.early_stop.model_copy(update=stop),
            "steps": recipe.steps.model_copy(update={"stop_when_decided": True}),
        }
    )
