"""Cost: weighs measured data sets as one number.

A data set's cost is the sum of these means; a perfect measurement has 0.

- over contacts above 2 mm²: the error of the area, |measured / true - 1|, at most 1; `SHAPE` times what the outline's
  intersection over union lacks to 1, since an area can be right by chance; and beside them `WRONG` for a judged area
  that is wrong by 35 % or more, rising from nothing at 15 %, `DOUBTED` for one that is not judged, and `DROP` for
  a judged area more than 25 % under an earlier judged one of its press (followed presses only);
- over untouched frames: 1 for an area where there is none, and `WRONG` more where it is judged; with another unit's
  reference 1 for what is judged only;
- over weak contacts, up to 2 mm²: 1 for one that is not found;
- over followed presses: `UNORDERED` for a Spearman correlation of measured and true area under 0.99.

The cost is the data sets' mean, with the weights of `parts.groups`. `WRONG` and `DOUBTED` make it worth while to judge
an area that is wrong in fewer than one in twenty cases.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fit.evaluation import LEAST_MM2, PressScore, Scores
from fit.parts import Groups

SHAPE, WRONG, DOUBTED, DROP, UNORDERED = 1.0, 1.0, 0.05, 0.5, 0.1
ORDERED = 0.99
RAMP = (0.15, 0.35)
"""Errors from which on a judged area counts as wrong, and counts in full: a step at 25 % would be all noise."""

Floats = npt.NDArray[np.float64]


def sums(score: PressScore, scored: str) -> Floats:
    """Return a press's part of its data set's three means, of contacts, of empty frames and of presses.

    Args:
        score: the press's measured steps.
        scored: as in `Group`.

    Returns:
        Sums and counts, shape (3, 2).
    """
    found = np.zeros((3, 2))
    for step in score.steps:
        if scored == "found":
            found[0] += (not step.has_area, 1) if 0 < step.true_mm2 <= LEAST_MM2 + 0.5 else (0, 0)
        elif step.true_mm2 > LEAST_MM2:
            loss = min(1.0, step.error) + SHAPE * (1 - step.overlap) + DROP * step.dropped
            loss += (
                WRONG * float(np.clip((step.error - RAMP[0]) / (RAMP[1] - RAMP[0]), 0, 1)) if step.judged else DOUBTED
            )
            found[0] += loss, 1
        elif step.true_mm2 == 0:
            found[1] += step.judged if scored == "judged" else step.has_area + WRONG * step.judged, 1
    if not np.isnan(score.spearman):
        found[2] += UNORDERED * (score.spearman < ORDERED), 1
    return found


def costs(scores: Scores, groups: Groups) -> dict[str, float]:
    """The cost of each data set."""
    return {name: float(_costs(_stacked(scores, groups, name).sum(axis=0))) for name in scores}


def cost(scores: Scores, groups: Groups) -> float:
    """The one cost: the weighted mean over the data sets."""
    return weighted(costs(scores, groups), groups)


def weighted(per_set: Mapping[str, float], groups: Groups) -> float:
    """The mean of the data sets' costs with their weights."""
    weights = {name: groups[name].weight for name in per_set}
    return sum(weights[name] * value for name, value in per_set.items()) / sum(weights.values())


def _stacked(scores: Scores, groups: Groups, name: str) -> Floats:
    return np.array([sums(one, groups[name].scored) for one in scores[name]])


def _costs(totals: Floats) -> Floats:
    """The cost of sums of shape (..., 3, 2)."""
    return (totals[..., 0] / np.maximum(totals[..., 1], 1e-9)).sum(axis=-1)


class Redrawn:
    """Draws of other presses in place of the data sets' own, the same for every trial, for an effect's standard error.

    Args:
        groups: the data sets.
        draws: how many.
    """

    def __init__(self, groups: Groups, draws: int = 400) -> None:
        generator = np.random.default_rng(0)
        self._groups = groups
        self._counts = {
            name: generator.multinomial(n, np.full(n, 1 / n), size=draws)
            for name, group in groups.items()
            if (n := len(group.presses))
        }

    def costs(self, scores: Scores) -> Floats:
        """The cost in each draw, shape (draws,)."""
        total, weights = np.zeros(1), 0.0
        for name, counts in self._counts.items():
            totals = np.einsum("dp,pms->dms", counts, _stacked(scores, self._groups, name))
            total = total + self._groups[name].weight * _costs(totals)
            weights += self._groups[name].weight
        return total / weights
