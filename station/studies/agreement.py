"""Attribute agreement: how far the same fruit gets the same decision, and the right one.

Source: Automotive Industry Action Group, Measurement Systems Analysis, 4th edition (2010), chapter III, section C:
effectiveness, miss rate, false alarm rate and Cohen's kappa, which is to be above 0.75.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

Decisions = npt.NDArray[np.bool_]
"""True for a passed fruit; shape (parts, operators, repeats)."""


@dataclass(frozen=True, slots=True)
class OperatorAgreement:
    """One operator's decisions."""

    operator: str
    parts: int
    repeated: int
    """Parts with the same decision in every repeat."""
    right: int | None
    """Parts with the right decision in every repeat; None if the truth is not known."""
    kappa: float | None
    """Cohen's kappa against the truth; None if it is not known or either never varies."""
    misses: tuple[int, int] | None
    """Damaged fruit passed, of how many decisions on damaged ones."""
    false_alarms: tuple[int, int] | None
    """Good fruit diverted, of how many decisions on good ones."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """An attribute study."""

    operators: tuple[OperatorAgreement, ...]
    between: tuple[tuple[str, str, float | None], ...]
    """Cohen's kappa of every two operators."""
    all_alike: int
    """Parts on which all operators decided alike every time."""
    parts: int


def agreement(passed: Decisions, operators: Sequence[str], good: npt.NDArray[np.bool_] | None = None) -> Agreement:
    """Compare decisions, shape (parts, operators, repeats), and the truth, shape (parts,) or None, with each other."""
    rows = tuple(_operator(name, passed[:, place], good) for place, name in enumerate(operators))
    between = tuple(
        (operators[a], operators[b], cohen_kappa(passed[:, a].ravel(), passed[:, b].ravel()))
        for a, b in combinations(range(len(operators)), 2)
    )
    flat = passed.reshape(passed.shape[0], -1)
    return Agreement(rows, between, int((flat == flat[:, :1]).all(axis=1).sum()), passed.shape[0])


def _operator(name: str, passed: Decisions, good: npt.NDArray[np.bool_] | None) -> OperatorAgreement:
    repeated = int((passed == passed[:, :1]).all(axis=1).sum())
    if good is None:
        return OperatorAgreement(name, passed.shape[0], repeated, None, None, None, None)
    truth = np.broadcast_to(good[:, None], passed.shape)
    return OperatorAgreement(
        name,
        passed.shape[0],
        repeated,
        int((passed == truth).all(axis=1).sum()),
        cohen_kappa(passed.ravel(), truth.ravel()),
        (int((passed & ~truth).sum()), int((~truth).sum())),
        (int((~passed & truth).sum()), int(truth.sum())),
    )


def cohen_kappa(one: npt.ArrayLike, other: npt.ArrayLike) -> float | None:
    """Agreement of two raters beyond chance (Cohen, Educational and Psychological Measurement 20 (1960) 37).

    Args:
        one: decisions, shape (n,).
        other: of the same n.

    Returns:
        1 for full agreement, 0 for what chance gives; None where neither varies and chance explains all.
    """
    a, b = np.asarray(one, bool), np.asarray(other, bool)
    observed = float(np.mean(a == b))
    by_chance = float(a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean()))
    return None if by_chance == 1.0 else (observed - by_chance) / (1.0 - by_chance)
