"""Search: moves one constant after the other to the value of least cost, on the part to fit on."""

from collections.abc import Sequence
from dataclasses import fields

from fit.cost import cost, costs
from fit.evaluation import Base, Scores, Trial
from fit.progress import report
from fit.runner import Runner
from fit.sensitivity import LEAST_EFFECT, Sensitivity, changed, trial
from station.vision.constants import CONSTANTS, Constants

GRID = (0.7, 0.85, 1.2, 1.4)
ROUNDS = 2
GAIN_ERRORS = 2.0
"""A move has to gain this many standard errors: less is the choice of seeds."""


def fitted_names(found: Sequence[Sensitivity]) -> list[str]:
    """The constants that the search moves: of origin `fit`, and of those that gain when changed by a fifth."""
    origin = {one.name: one.metadata["origin"] for one in fields(Constants)}
    promising = [row for row in found if any(one.effect < -max(LEAST_EFFECT, one.error) for one in row.near)]
    return [row.name for row in promising if origin.get(row.name, "").startswith("fit")]


def search(runner: Runner, names: Sequence[str]) -> dict[str, float]:
    """New values of the constants that move.

    Args:
        runner: of the data sets.
        names: of the constants, in the order in which they are moved.
    """
    best = Trial()
    scores = runner.shipped()
    moved: dict[str, float] = {}
    promising = list(names)
    for number in range(ROUNDS):
        next_round: list[str] = []
        for name in promising:
            value, after, gain, seen = _best_of(runner, name, best, scores)
            if seen:
                next_round.append(name)
            if after is not None:
                moved[name], best, scores = value, trial(name, value, best), after
                report(f"round {number + 1}: {name} = {value:g} gains {gain:.4f}: {cost(scores, runner.parts[0]):.4f}")
        promising = next_round
    return {name: value for name, value in moved.items() if value != getattr(CONSTANTS, name)}


def _best_of(runner: Runner, name: str, best: Trial, scores: Scores) -> tuple[float, Scores | None, float, bool]:
    """The grid's best value, its scores (None where it gains too little), its gain, and whether it gains at all."""
    now = getattr(best.constants, name)
    tried = list(dict.fromkeys(changed(now, factor) for factor in GRID))
    runs = runner.run(name, [trial(name, value, best) for value in tried], base=Base(best, scores))
    effects = [runner.effect(one, scores) for one in runs]
    place = min(range(len(tried)), key=lambda k: effects[k][0])
    effect, error = effects[place]
    enough = -effect > max(LEAST_EFFECT, GAIN_ERRORS * error)
    return tried[place], runs[place] if enough else None, -effect, effect < -LEAST_EFFECT


def found_table(runner: Runner, moved: dict[str, float]) -> list[str]:
    """The found values beside the shipped: each move alone, then all together, on both parts."""
    if not moved:
        return ["No constant gains more than the choice of seeds: the shipped values stay."]
    alone = [trial(name, value) for name, value in moved.items()]
    together = Trial()
    for name, value in moved.items():
        together = trial(name, value, together)
    both = range(len(runner.parts))
    base = [runner.shipped(part) for part in both]
    runs = [
        runner.run(f"found values, part {part + 1}", [*alone, together], part, Base(Trial(), base[part]))
        for part in both
    ]
    lines = ["| constant | shipped | found | cost, fit | cost, validation |", "|---|---|---|---|---|"]
    rows = [(f"`{n}`", f"{getattr(CONSTANTS, n):g}", f"{value:.4g}") for n, value in moved.items()]
    for number, row in enumerate([*rows, ("all together", "", "")]):
        effects = [runner.effect(runs[part][number], base[part], part) for part in both]
        lines.append(f"| {' | '.join(row)} | " + " | ".join(f"{e:+.4f} ± {error:.4f}" for e, error in effects) + " |")
    lines += [
        "",
        "| data set | shipped, fit | found, fit | shipped, validation | found, validation |",
        "|---|---|---|---|---|",
    ]
    last = [scores[-1] for scores in runs]
    columns = [costs(one, runner.parts[part]) for part in both for one in (base[part], last[part]) if one is not None]
    if len(columns) == 4:
        lines += [
            f"| {name} | " + " | ".join(f"{column[name]:.4f}" for column in columns) + " |" for name in columns[0]
        ]
    return lines
