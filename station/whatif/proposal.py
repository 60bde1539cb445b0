"""Proposed limits from marked fruit, one for each closing, with their figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from station.records.marks import Mark
from station.settings.damage import LARGEST_EXPONENT, SizeOfFruit
from station.settings.recipe_model import Recipe
from station.whatif.limits import (
    Costs,
    Exponent,
    MarkedFruit,
    Values,
    at_reference,
    choose,
    cross_validated,
    errors,
    exponent_of,
    fewest_fruit,
    marked_fruit,
    rate_interval,
)
from station.whatif.stored import StoredPress

_KNOWN_SHARE = 0.9
"""Share of the good fruit that has to reach a closing; else it is not proposed: the others' areas there are unknown."""
_SURE = 2.0
"""Standard errors by which the fruit's own exponent has to differ from the recipe's to replace it."""
_LEAST_EXPONENT = 0.05
"""No smaller exponent of the size is proposed: a recipe's is above 0. An estimate."""
_CURVE_POINTS = 80
_RATES_TO_SHOW = (0.05, 0.01)
"""False accept rates for which the report gives the number of marked fruit that would show them."""


class LeftOut(NamedTuple):
    """Errors on fruit that nothing was chosen on: exponent, limit and closing are each time those of the others.

    A fruit without a constraint at their closing is not counted.
    """

    good_diverted: int
    good: int
    bad_passed: int
    bad: int


@dataclass(frozen=True, slots=True)
class Proposal:
    """The limit of the least cost at one closing."""

    closing_mm: float
    fruit: tuple[MarkedFruit, ...]
    unknown: int
    """Marked fruit without a constraint at this closing."""
    exponent: float
    """For the draft; 0 if the recipe does not use the size."""
    found_exponent: Exponent | None
    good: Values
    bad: Values
    """Least limits by which the fruit pass, for a fruit of the reference length, mm²."""
    limit_mm2: float
    by_others: tuple[int, int] | None
    """Good fruit diverted and bad ones passed, each by the limit of the others at this closing; None with too few."""
    left_out: LeftOut | None = None
    """Of the proposal of the least cost; None with too few, and of the others."""

    def cost(self, costs: Costs) -> float:
        """Return the cost by which closings are compared, of an average fruit by the limits of the others.

        That of the closing chosen by it is too small, as the least of several. With too few fruit it is the worst case.
        """
        diverted, passed = self.by_others or (len(self.good), len(self.bad))
        return costs.of(passed / len(self.bad), diverted / len(self.good))


def proposals(
    stored: Sequence[StoredPress], marked: Mapping[int, Mark], own: Mapping[str, Recipe], recipe: Recipe, costs: Costs
) -> list[Proposal]:
    """Propose a limit of a recipe for each closing that enough of the marked fruit reached, the cheapest first.

    Args:
        own: the recipes that they were pressed by, by their hash.
    """
    good = [marked[each.sequence] == "good" for each in stored]
    fruit = {
        closing_mm: [
            marked_fruit(each.judged, own[each.recipe_sha256], closing_mm, good=is_good, draft=recipe)
            for each, is_good in zip(stored, good, strict=True)
        ]
        for closing_mm in sorted({*recipe.steps.result_closings_mm, *(each.closing_mm for each in recipe.damage.area)})
    }
    return proposals_of(fruit, good, recipe.damage.size, costs)


def proposals_of(
    fruit: Mapping[float, Sequence[MarkedFruit | None]], good: Sequence[bool], rule: SizeOfFruit | None, costs: Costs
) -> list[Proposal]:
    """Propose a limit for each closing, the cheapest first, which has its errors on fruit left out.

    Args:
        fruit: at each closing, mm, in ascending order, the constraint of each marked fruit, always in the same order.
        good: whether it is marked good.
    """
    found = _by_cost(fruit, good, rule, costs)
    return [replace(each, left_out=_left_out(fruit, good, rule, costs)) for each in found[:1]] + found[1:]


def _by_cost(
    fruit: Mapping[float, Sequence[MarkedFruit | None]], good: Sequence[bool], rule: SizeOfFruit | None, costs: Costs
) -> list[Proposal]:
    found = [_at(closing_mm, seen, sum(good), rule, costs) for closing_mm, seen in fruit.items()]
    known = [each for each in found if each is not None]
    return sorted(known, key=lambda each: (each.cost(costs), each.closing_mm))


def _left_out(
    fruit: Mapping[float, Sequence[MarkedFruit | None]], good: Sequence[bool], rule: SizeOfFruit | None, costs: Costs
) -> LeftOut | None:
    """Judge each fruit by the proposal that is made without it; None where there is none."""
    errors_of = {True: [0, 0], False: [0, 0]}
    for place, is_good in enumerate(good):
        others = {closing_mm: [*seen[:place], *seen[place + 1 :]] for closing_mm, seen in fruit.items()}
        found = _by_cost(others, [*good[:place], *good[place + 1 :]], rule, costs)
        if not found:
            return None
        one = fruit[found[0].closing_mm][place]
        if one is None:
            continue
        (passes_from_mm2,) = np.concatenate(at_reference([one], found[0].exponent, _reference_mm(rule)))
        passed = bool(passes_from_mm2 <= found[0].limit_mm2)
        errors_of[is_good][0] += passed != is_good
        errors_of[is_good][1] += 1
    return LeftOut(*errors_of[True], *errors_of[False])


def _at(
    closing_mm: float,
    seen: Sequence[MarkedFruit | None],
    all_good: int,
    rule: SizeOfFruit | None,
    costs: Costs,
) -> Proposal | None:
    fruit = tuple(one for one in seen if one is not None)
    reached = sum(one.area_mm2 is not None for one in fruit if one.good)
    found = exponent_of(fruit)
    exponent = 0.0 if rule is None else rule.exponent
    if rule is not None and found is not None and abs(found.value - exponent) > _SURE * found.standard_error:
        exponent = round(min(max(found.value, _LEAST_EXPONENT), LARGEST_EXPONENT), 2)
    good, bad = at_reference(fruit, exponent, _reference_mm(rule))
    if reached < _KNOWN_SHARE * all_good or not np.isfinite(good).any() or not len(bad):
        return None
    return Proposal(
        closing_mm=closing_mm,
        fruit=fruit,
        unknown=len(seen) - len(fruit),
        exponent=exponent,
        found_exponent=found,
        good=good,
        bad=bad,
        limit_mm2=choose(good, bad, costs),
        by_others=cross_validated(good, bad, costs),
    )


def _reference_mm(rule: SizeOfFruit | None) -> float:
    return 1.0 if rule is None else rule.reference_mm


def figures_of(proposal: Proposal, costs: Costs) -> dict[str, Any]:
    """Return a proposal's figures by name, with the costs that the limit was chosen for."""
    good, bad, limit = proposal.good, proposal.bad, np.array([proposal.limit_mm2])
    diverted, passed = (int(count[0]) for count in errors(good, bad, limit))
    found = proposal.found_exponent
    return {
        "closing_mm": proposal.closing_mm,
        "limit_mm2": proposal.limit_mm2,
        "exponent": proposal.exponent,
        "exponent_of_these_fruit": None
        if found is None
        else {"value": found.value, "standard_error": found.standard_error, "fruit": found.fruit},
        "not_known": proposal.unknown,
        "at_least": sum(one.at_least for one in proposal.fruit),
        "good_diverted": _share(diverted, len(good)),
        "bad_passed": _share(passed, len(bad)),
        "left_out": None
        if proposal.left_out is None
        else {
            "good_diverted": _share(proposal.left_out.good_diverted, proposal.left_out.good),
            "bad_passed": _share(proposal.left_out.bad_passed, proposal.left_out.bad),
        },
        "cost": proposal.cost(costs),
        "bad_needed_to_show": {f"{rate:g}": fewest_fruit(rate) for rate in _RATES_TO_SHOW},
        "curve": _curve(proposal),
    }


def _curve(proposal: Proposal) -> list[dict[str, Any]]:
    """Return both errors over the limit, each with its interval."""
    known = np.concatenate([proposal.good, proposal.bad])
    known = known[np.isfinite(known)]
    limits = np.linspace(0.95 * known.min(), 1.05 * known.max(), _CURVE_POINTS)
    counts = zip(limits, *errors(proposal.good, proposal.bad, limits), strict=True)
    return [
        {
            "limit_mm2": float(limit),
            "good_diverted": _share(int(diverted), len(proposal.good)),
            "bad_passed": _share(int(passed), len(proposal.bad)),
        }
        for limit, diverted, passed in counts
    ]


def _share(count: int, of: int) -> dict[str, Any]:
    interval = rate_interval(count, of)
    return {"count": count, "of": of, "share": count / of if of else None, "interval": [interval.low, interval.high]}
