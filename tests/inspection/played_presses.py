"""Presses of every kind, drawn from a seed, and their judgements in plain values."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

from station.inspection.fruit_size import FruitSize
from station.inspection.judge import AreaAt, Finding, Judgement, Stop, early_stop, judge
from station.inspection.press import Measured, Press
from station.inspection.second_press import needs_second_press, together
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.vocabulary import Flag, Reason

PRESSES = 160
_RECIPES = Path(__file__).parents[1] / "recipe_store" / "golden" / "form_1"
"""Of another release: what is shipped may change."""
_SIZE = {
    "from": "length",
    "reference_mm": 40.0,
    "exponent": 0.8,
    "expected_length": {"smallest_mm": 20.0, "largest_mm": 70.0},
    "uncertainty_mm": 0.6,
    "without_size": "plain_limit",
    "spread": 0.17,
}


def recipes() -> Iterator[Recipe]:
    """Yield a recipe for each way to decide, to stop, and to use the size."""
    plain = find_recipe("strawberry", _RECIPES)
    for decided_by in ("every_limit", "first_trusted", "every_trusted"):
        for decides in (False, True):
            for size in (None, _SIZE):
                values = plain.model_dump(mode="json")
                values["damage"] = {
                    "area": [
                        {"closing_mm": 3.0, "area_mm2": 70.0, "least_area_mm2": 25.0},
                        {"closing_mm": 6.0, "area_mm2": 130.0, "least_area_mm2": 40.0},
                    ],
                    "decided_by": decided_by,
                    "growth_mm2_per_mm": 32.0,
                    "size": size,
                    "uncertainty": {"coverage": 0.95, "repeatability": [{"closing_mm": 3.0, "relative": 0.04}]},
                }
                values["steps"] |= {"stop_when_decided": decides, "result_closings_mm": [3.0, 6.0, 8.0]}
                values["early_stop"] = {"area_mm2": 175.0, "growth_mm2_per_mm": 45.0}
                yield Recipe.model_validate_json(json.dumps(values))


def press(number: int) -> Press:
    """Return a press: mostly a rising curve, about one in ten steps doubtful, some cut short or interrupted."""
    rng = Random(number)
    growth, bends = rng.choice((8.0, 14.0, 20.0, 22.0, 26.0, 34.0, 50.0)), rng.choice((0.0, 0.0, 1.5, -1.0))
    starts_mm = rng.choice((0.0, 0.0, 0.0, 0.5, 1.2))
    points: list[Measured] = []
    for step in range(rng.choice((0, 3, 5, 7, 9, 9, 9, 9))):
        closing_mm = step + rng.choice((0.0, 0.0, -0.02, 0.01))
        area = max(0.0, closing_mm - starts_mm) * (growth + bends * step) + rng.uniform(-2.0, 2.0)
        area = max(0.0, area * rng.choice((1.0,) * 14 + (0.6, 1.3)))
        flags = {rng.choice(list(Flag))} if rng.random() < 0.04 else set[Flag]()
        confidence = rng.choice((0.9,) * 30 + (0.45, 0.3, None))
        points.append(Measured(closing_mm, area, round(area * 1400), confidence, frozenset(flags)))
        if rng.random() < 0.05:
            points.append(replace(points[-1], area_mm2=area * 1.1, confidence=0.7))
    return Press(
        onset_mm=rng.choice((35.0,) * 14 + (None, 2.0)),
        onset_uncertainty_mm=rng.choice((0.0, 0.4, 1.0)),
        points=tuple(points),
        interruptions=rng.choice(((),) * 14 + ((rng.choice(list(Reason)),), (Reason.LATE, Reason.NO_CONTACT))),
        size=FruitSize(length_mm=rng.choice((None, 33.0, 33.0, 44.0, 52.0, 52.0, 38.0, 90.0))),
        resolution_mm=rng.choice((0.0, 0.4)),
        scale_uncertainty=rng.choice((0.0, 0.01)),
    )


def judged(number: int, recipe: Recipe) -> dict[str, Any]:
    """Return the judgement of a press in plain values, its first early stop, and what a second press makes of it."""
    whole = press(number)
    verdict = judge(whole, recipe)
    stops = (early_stop(replace(whole, points=whole.points[:count]), recipe) for count in range(len(whole.points) + 1))
    first = next(((count, stop) for count, stop in enumerate(stops) if stop is not None), None)
    both = judge(together((press(number + 1000), whole)), recipe)
    return _plain(verdict) | {
        "stops": None if first is None else [first[0], *_stop(first[1])],
        "again": needs_second_press(verdict),
        "together": [both.outcome, [str(reason) for reason in both.reasons], _areas(both.areas)],
    }


def _plain(verdict: Judgement) -> dict[str, Any]:
    at, growth = verdict.deciding, verdict.growth
    return {
        "outcome": verdict.outcome,
        "findings": [_finding(finding) for finding in verdict.findings],
        "deciding": None if at is None else [_short(at.closing_mm), _short(at.area_mm2)],
        "areas": _areas(verdict.areas),
        "growth": None
        if growth is None
        else [_short(growth.mm2_per_mm), _short(growth.uncertainty_mm2_per_mm), _short(growth.to_closing_mm)],
        "partial": verdict.partial,
        "stopped": _stop(verdict.stopped),
        "budget": _short(verdict.budget.expanded),
        "summary": None if verdict.summary is None else str(verdict.summary),
    }


def _stop(stop: Stop | None) -> list[Any]:
    return [] if stop is None else [str(stop.message), *([_finding(stop.finding)] if stop.finding else [])]


def _finding(finding: Finding) -> list[Any]:
    values = (finding.value, finding.limit, finding.closing_mm)
    return [str(finding.reason), str(finding.message), *(_short(value) for value in values), finding.proves]


def _areas(areas: tuple[AreaAt, ...]) -> list[list[float | None]]:
    return [[_short(area.area_mm2), _short(area.uncertainty_mm2), _short(area.limit_mm2)] for area in areas]


def _short(value: float | None) -> float | None:
    """Seven digits: more are the processor's."""
    return None if value is None else float(f"{value:.7g}")
