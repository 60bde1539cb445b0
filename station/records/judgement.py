"""Judgement among an inspection's measures: the limits' factor and the uncertainty budget."""

from collections.abc import Iterator, Mapping
from typing import Any

from station.inspection.judge import Judgement
from station.inspection.uncertainty import COMPONENTS

_FACTOR, _COMBINED, _SHARE = "coverage_factor", "uncertainty", "uncertainty_"
_LIMITS = "limit_factor"


def judgement_measures(verdict: Judgement) -> dict[str, float]:
    """Return a verdict's relative standard uncertainties for the record; none if the last threshold was not reached."""
    if verdict.summary is None:
        return {}
    shares = {_SHARE + each.name: round(each.relative, 5) for each in verdict.budget.components}
    combined, factor = round(verdict.budget.combined, 5), round(verdict.budget.factor, 4)
    scaled = {} if verdict.limit_factor == 1 else {_LIMITS: round(verdict.limit_factor, 5)}
    return {**scaled, **shares, _COMBINED: combined, _FACTOR: factor}


def limit_factor(measures: Mapping[str, Any]) -> float:
    """Return the ratio of the fruit's limits to its recipe's."""
    return float(measures.get(_LIMITS) or 1.0)


def is_judgement(measure: str) -> bool:
    """Check whether a measure is one of the judgement's."""
    return measure in {_FACTOR, _COMBINED} or measure.startswith(_SHARE)


def budget_rows(measures: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Return the relative standard uncertainties of a budget, if any: each component, combined, and the guard band."""
    if _COMBINED not in measures or _FACTOR not in measures:
        return
    for name, text in COMPONENTS.items():
        yield text, float(measures.get(_SHARE + name) or 0.0)
    combined, factor = float(measures[_COMBINED]), float(measures[_FACTOR])
    yield "combined", combined
    yield f"guard band, {factor:.2f} times that", factor * combined
