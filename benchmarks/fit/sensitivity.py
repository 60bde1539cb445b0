"""Sensitivity: what it costs to change each constant.

By a fifth first; far where that is free; and where that is free too, to a value at which it does nothing.
"""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

from fit.cost import costs
from fit.evaluation import Base, Scores, Trial
from fit.runner import Runner
from station.settings.segmentation import RobustParameters
from station.vision.constants import CONSTANTS, Constants

NEAR, WIDE = (0.8, 1.25), (0.4, 2.5)
LEAST_EFFECT = 0.0005
"""Of the cost: a smaller effect is worth no constant."""
ERRORS = 2.0
"""Standard errors beyond which an effect is more than the choice of seeds."""
RECIPE = ("gate_ratio", "least_bend", "edge_stiffness", "smallest_contact_px")
"""The recipe's parameters that are changed in the same way, at their defaults."""
OUT = {
    "border_chord": 2.0,
    "confirmed_share": 2.0,
    "corner_chord": 2.0,
    "displacement_prior": 1e-6,
    "fine_on_skin": 1e9,
    "flat_field_floor": 1e6,
    "halo_over_least": 0.0,
    "highest_harmonic": 1e6,
    "lit_share": -1.0,
    "most_drift_share": 1e9,
    "pattern_blur": 0.3,
    "saturated_share": 2.0,
    "stripe_prior": 1e9,
    "support_least": 0.0,
    "wide_levels": 1e9,
    "wide_share": 2.0,
    "wide_threshold": 1.0,
    "recipe: edge_stiffness": 1e-9,
    "recipe: smallest_contact_px": 0.0,
}
"""Values at which a constant does nothing, of those of which near and far values may all do alike."""


class Change(NamedTuple):
    """Effect of one changed value."""

    value: float
    effect: float
    """On the cost; infinite where no method can be made with the value."""
    error: float
    """The effect's standard error when presses are redrawn."""
    suffers: str
    """The data set whose share of the effect is largest, and its own cost's change; empty where nothing changes."""

    @property
    def matters(self) -> bool:
        """True if the effect is larger than the choice of seeds explains."""
        return abs(self.effect) > max(LEAST_EFFECT, ERRORS * self.error)


class Sensitivity(NamedTuple):
    """Effects of one constant."""

    name: str
    value: float
    near: tuple[Change, Change]
    wide: tuple[Change, Change] | None
    """Where neither near change matters."""
    out: Change | None = None
    """With what it is for left out, where no other change matters."""

    @property
    def matters(self) -> bool:
        """True if the constant matters when changed by a fifth."""
        return any(change.matters for change in self.near)

    @property
    def matters_at_all(self) -> bool:
        """True if the constant matters when changed by a fifth, when changed far, or when left out."""
        far = (*(self.wide or ()), *([] if self.out is None else [self.out]))
        return self.matters or any(change.matters for change in far)

    @property
    def size(self) -> float:
        """The larger effect of the near changes."""
        return max(abs(change.effect) for change in self.near)


def values() -> dict[str, float]:
    """Every constant, and the recipe's parameters, by name."""
    own = {one.name: getattr(CONSTANTS, one.name) for one in fields(Constants)}
    return own | {f"recipe: {name}": getattr(RobustParameters(), name) for name in RECIPE}


def changed(value: float, factor: float) -> float:
    """A value times a factor; an integer moves by whole steps and stays odd or even."""
    if not isinstance(value, int):
        return value * factor
    step = 2 if value % 2 else 1
    moved = round((value * factor - value) / step) * step
    return max(1, value + (moved or (step if factor > 1 else -step)))


def trial(name: str, value: float, base: Trial | None = None) -> Trial:
    """A trial with one constant or parameter changed.

    Args:
        name: as in `values`.
        value: the new one.
        base: the trial to change; that as shipped where left out.
    """
    base = base or Trial()
    change: dict[str, Any] = {name.removeprefix("recipe: "): value}
    if name.startswith("recipe: "):
        return base._replace(parameters=base.parameters.model_copy(update=change))
    return base._replace(constants=replace(base.constants, **change))


def sensitivity(runner: Runner) -> list[Sensitivity]:
    """The effects of every constant, the largest first."""
    near = _changes(runner, "sensitivity", list(values()), NEAR)
    still = [name for name, changes in near.items() if not any(change.matters for change in changes)]
    wide = _changes(runner, "sensitivity, far", still, WIDE)
    found = [Sensitivity(name, value, near[name], wide.get(name)) for name, value in values().items()]
    return left_out(runner, sorted(found, key=lambda one: -one.size))


def left_out(runner: Runner, found: list[Sensitivity]) -> list[Sensitivity]:
    """The same, with what it costs to leave out what does not matter otherwise."""
    still = [row.name for row in found if not row.matters_at_all and row.name in OUT]
    changes = dict(zip(still, _effects(runner, "left out", [(name, OUT[name]) for name in still]), strict=True))
    return [row._replace(out=changes.get(row.name)) for row in found]


def _changes(
    runner: Runner, name: str, names: list[str], factors: tuple[float, float]
) -> dict[str, tuple[Change, Change]]:
    now = values()
    found = _effects(runner, name, [(one, changed(now[one], factor)) for one in names for factor in factors])
    return {one: (found[2 * k], found[2 * k + 1]) for k, one in enumerate(names)}


def _effects(runner: Runner, name: str, new: list[tuple[str, float]]) -> list[Change]:
    base = runner.shipped()
    scores = runner.run(name, [trial(*one) for one in new], base=Base(Trial(), base))
    return [_change(runner, value, after, base) for (_, value), after in zip(new, scores, strict=True)]


def _change(runner: Runner, value: float, scores: Scores | None, base: Scores) -> Change:
    groups = runner.parts[0]
    suffers = "no method"
    if scores is not None:
        before, after = costs(base, groups), costs(scores, groups)
        change = {name: after[name] - before[name] for name in after}
        worst = max(change, key=lambda name: groups[name].weight * change[name])
        if change[worst] <= 0:
            worst = max(change, key=lambda name: groups[name].weight * abs(change[name]))
        suffers = f"{worst} {change[worst]:+.3f}" if change[worst] else ""
    return Change(value, *runner.effect(scores, base), suffers)


def stored(path: Path) -> list[Sensitivity] | None:
    """The last run's, of constants that are still there, or None."""
    if not path.exists():
        return None
    rows = [
        Sensitivity(
            name, value, _pair(near), None if wide is None else _pair(wide), None if out is None else Change(*out)
        )
        for name, value, near, wide, out in json.loads(path.read_text())
    ]
    return [row for row in rows if row.name in values()]


def _pair(changes: list[list[Any]]) -> tuple[Change, Change]:
    return Change(*changes[0]), Change(*changes[1])


def store(path: Path, found: list[Sensitivity]) -> None:
    """Write them for the search, which leaves out what does not matter."""
    path.write_text(json.dumps(found))


def table(found: list[Sensitivity]) -> list[str]:
    """The table of the constants that matter, the largest effect first."""
    lines = [
        f"| constant | value | at x{NEAR[0]:g} | at x{NEAR[1]:g} | what suffers |",
        "|---|---|---|---|---|",
    ]
    for row in found:
        if row.matters:
            worst = max(row.near, key=lambda change: change.effect)
            cells = " | ".join(_cell(change) for change in row.near)
            lines.append(f"| `{row.name}` | {row.value:g} | {cells} | {worst.suffers} |")
    never = [f"`{row.name}`" for row in found if not row.matters_at_all]
    summary = (
        f"Matter when changed by a fifth: {sum(row.matters for row in found)} of {len(found)}. Matter neither at "
        f"{WIDE[0]:g} or {WIDE[1]:g} times nor when left out ({len(never)}): {', '.join(never) or 'none'}."
    )
    return [*lines, "", summary]


def far_table(found: list[Sensitivity]) -> list[str]:
    """The effects of the far changes, of the constants that matter only so."""
    lines = [f"| constant | cost at x{WIDE[0]:g} | at x{WIDE[1]:g} | what suffers |", "|---|---|---|---|"]
    for row in found:
        if row.wide is not None and any(change.matters for change in row.wide):
            worst = max(row.wide, key=lambda change: change.effect)
            lines.append(f"| `{row.name}` | {' | '.join(_cell(one) for one in row.wide)} | {worst.suffers} |")
    return lines


def out_table(found: list[Sensitivity]) -> list[str]:
    """The table of what it costs to leave out what the constants are for that matter neither near nor far."""
    lines = ["| constant | value | left out by | cost | what suffers |", "|---|---|---|---|---|"]
    rows = [(row, row.out) for row in found if row.out is not None]
    lines += [f"| `{row.name}` | {row.value:g} | {out.value:g} | {_cell(out)} | {out.suffers} |" for row, out in rows]
    return lines


def _cell(change: Change) -> str:
    if change.effect == float("inf"):
        return "no method"
    return f"{change.effect:+.4f} ± {change.error:.4f}{' *' if change.matters else ''}"
