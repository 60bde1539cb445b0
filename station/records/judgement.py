"""The judgement in an inspection's record: the area beside its limit, and the budget of its uncertainty."""

from collections.abc import Iterator, Mapping
from typing import Any

from station.inspection.judge import Verdict
from station.inspection.uncertainty import COMPONENTS

_SENTENCE, _FACTOR, _COMBINED, _SHARE = "judgement", "coverage_factor", "uncertainty", "uncertainty_"
_LIMITS = "limit_factor"


def judgement_measures(verdict: Verdict) -> dict[str, float | str]:
    """What is kept of a verdict beside its reasons: shares of the area, each a relative standard uncertainty.

    Args:
        verdict: of a press that touched something; nothing is kept where its last threshold was not reached.
    """
    if not verdict.summary:
        return {}
    shares = {_SHARE + each.name: round(each.relative, 5) for each in verdict.budget.components}
    combined, factor = round(verdict.budget.combined, 5), round(verdict.budget.factor, 4)
    scaled = {} if verdict.limit_factor == 1 else {_LIMITS: round(verdict.limit_factor, 5)}
    return {_SENTENCE: verdict.summary, **scaled, **shares, _COMBINED: combined, _FACTOR: factor}


def limit_factor(measures: Mapping[str, Any]) -> float:
    """By which the fruit's limits differ from its recipe's.

    Args:
        measures: an inspection's.
    """
    return float(measures.get(_LIMITS) or 1.0)


def is_judgement(measure: str) -> bool:
    """Whether a measure is one of the judgement's.

    Args:
        measure: its name.
    """
    return measure in {_SENTENCE, _FACTOR, _COMBINED} or measure.startswith(_SHARE)


def judgement_sentence(measures: Mapping[str, Any]) -> str:
    """The area with its uncertainty beside the limit, a sentence; empty where the record has none.

    Args:
        measures: an inspection's.
    """
    return str(measures.get(_SENTENCE) or "")


def budget_rows(measures: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """The budget's table: each component with its relative standard uncertainty, then combined, then the guard band.

    Args:
        measures: an inspection's; of one without a budget there are no rows.
    """
    if _COMBINED not in measures or _FACTOR not in measures:
        return
    for name, text in COMPONENTS.items():
        yield text, float(measures.get(_SHARE + name) or 0.0)
    combined, factor = float(measures[_COMBINED]), float(measures[_FACTOR])
    yield "combined", combined
    yield f"guard band, {factor:.2f} times that", factor * combined
