"""The page of the triggers over disturbed links, and its chart."""

import os
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from plc_interface.plc_simulator.program import Decision

from .link_results import LAWS, Fruit, Results
from .proxy import Kind
from .routes import LinkName

_SAFE_S = 0.25
"""Promise: from the first sign of a fault until no trigger would be accepted."""
_READY_S = {LinkName.MODBUS: 2.0, LinkName.CHANNEL: 2.0, LinkName.CAMERA: 5.0}
"""Promise: from a fault's end to ready again, of the line's PLC and of the camera."""
_DECISIONS = tuple(str(decision) for decision in Decision)


def sections_of(made: Results, chart: Path) -> dict[str, list[str]]:
    """Return the page's measured sections, and draw its chart.

    Args:
        made: all stories.
        chart: the file to draw to.
    """
    fruits = made.fruits
    disturbed = [fruit for fruit in fruits if fruit.touched]
    _draw(disturbed, chart)
    return {
        "played": _played(made, disturbed),
        "laws": _laws(made),
        "times": _times(disturbed),
        "kinds": _kinds(disturbed),
        "outcomes": _outcomes(fruits),
        "misled": _misled(fruits),
    }


def _played(made: Results, disturbed: Sequence[Fruit]) -> list[str]:
    fruits = made.fruits
    triggers, minutes = sum(story.triggers for story in made.stories), sum(fruit.took_s for fruit in fruits) / 60
    remedies = Counter(remedy for fruit in fruits for remedy in fruit.remedies)
    persons = ", ".join(f"`{name}` {times} times" for name, times in sorted(remedies.items())) or "nothing"
    seeds = [story.seed for story in made.stories]
    first, last = min(seeds, default=0), max(seeds, default=0)
    pace = f"{triggers / minutes:.0f}" if minutes else "no"
    return [
        f"- **{triggers:,}** triggers in {len(seeds)} stories, seeds {first} to {last}.",
        f"- {sum(bool(fruit.link) for fruit in fruits):,} disturbances, of which {len(disturbed):,} met bytes or a",
        f"  connection; {sum(bool(fruit.signs) for fruit in disturbed):,} of them showed a sign at the interface.",
        f"- {sum(fruit.bruised for fruit in fruits):,} of the fruits were bruised.",
        f"- {pace} triggers a minute of a station, with all waits for its recovery.",
        f"- Remedies by a person: {persons}; for {sum(bool(fruit.remedies) for fruit in fruits)} fruits.",
        f"- Machine: {os.cpu_count()} cores, {platform.machine()}, load average {os.getloadavg()[2]:.1f} over the last",
        "  15 minutes, with other work beside it.",
    ]


def _laws(made: Results) -> list[str]:
    broken = [(story.seed, *each) for story in made.stories for each in story.all_broken]
    by_law = Counter(law for law, _ in {(law, seed) for seed, _, law, _ in broken})
    return [
        "| law | stories that broke it |",
        "|---|---|",
        *(f"| {law} | {by_law[law]} |" for law in LAWS),
        *(f"\nStory {seed}, fruit {number or 'after the last'}: {how}" for seed, number, _, how in broken),
    ]


def _times(disturbed: Sequence[Fruit]) -> list[str]:
    lines = _header(
        "link", "met", "with a sign", "fault to first sign", "first sign to no trigger accepted", "within 250 ms",
        "fault's end to ready again", "promise", "within it",
    )  # fmt: skip
    for link in LinkName:
        of_link = [fruit for fruit in disturbed if fruit.link == link]
        signs = [fruit for fruit in of_link if fruit.detected_s is not None]
        safe_s = _values(signs, lambda fruit: fruit.safe_s)
        ready_s = _values([fruit for fruit in signs if not fruit.remedies], lambda fruit: fruit.ready_s)
        limit_s = _READY_S.get(link)
        cells = (
            link.value,
            str(len(of_link)),
            str(len(signs)),
            _spread(_values(signs, lambda fruit: fruit.detected_s)),
            _spread(safe_s),
            _share(safe_s, _SAFE_S),
            _spread(ready_s),
            "none" if limit_s is None else f"{limit_s:g} s",
            "" if limit_s is None else _share(ready_s, limit_s),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _kinds(disturbed: Sequence[Fruit]) -> list[str]:
    lines = _header(
        "link", "disturbance", "met", "with a sign", "fault to first sign", "to no trigger accepted", "to ready again",
        "by a person",
    )  # fmt: skip
    for link in LinkName:
        for kind in Kind:
            those = [fruit for fruit in disturbed if (fruit.link, fruit.kind) == (link, kind)]
            signs = [fruit for fruit in those if fruit.detected_s is not None]
            alone = [fruit for fruit in signs if not fruit.remedies]
            cells = (
                link.value,
                kind.value,
                str(len(those)),
                str(len(signs)),
                _spread(_values(signs, lambda fruit: fruit.detected_s)),
                _spread(_values(signs, lambda fruit: fruit.safe_s)),
                _spread(_values(alone, lambda fruit: fruit.ready_s)),
                str(sum(bool(fruit.remedies) for fruit in those)),
            )
            lines += [f"| {' | '.join(cells)} |"] if those else []
    return lines


def _outcomes(fruits: Sequence[Fruit]) -> list[str]:
    lines = _header("link", "fruit", *_DECISIONS)
    for link in ("", *LinkName):
        for bruised in (False, True):
            found = Counter(
                fruit.outcome
                for fruit in fruits
                if (fruit.link if fruit.touched else "") == link and fruit.bruised is bruised
            )
            cells = (link or "none", "bruised" if bruised else "sound", *(str(found[name]) for name in _DECISIONS))
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def _misled(fruits: Sequence[Fruit]) -> list[str]:
    misled = [(fruit, how) for fruit in fruits for how in fruit.misled]
    return [
        f"Values that a corruption on Modbus changed and the PLC used: {len(misled)}.",
        *(f"- Story {fruit.seed}, fruit {fruit.number}: {how}." for fruit, how in misled),
    ]


def _header(*columns: str) -> list[str]:
    return [f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}"]


def _values(fruits: Iterable[Fruit], of: Callable[[Fruit], float | None]) -> list[float]:
    return [value for fruit in fruits if (value := of(fruit)) is not None]


def _spread(values_s: Sequence[float]) -> str:
    """Median, 95th percentile and most."""
    if not values_s:
        return ""
    return " / ".join(f"{value:.2f}" for value in (*np.percentile(values_s, [50, 95]), max(values_s))) + " s"


def _share(values_s: Sequence[float], limit_s: float) -> str:
    return f"{sum(value <= limit_s for value in values_s)} of {len(values_s)}" if values_s else ""


def _draw(disturbed: Sequence[Fruit], chart: Path) -> None:
    """Draw each time's distribution by link, as the share of disturbances within a time."""
    what: tuple[tuple[str, Callable[[Fruit], float | None]], ...] = (
        ("fault to first sign, s", lambda fruit: fruit.detected_s),
        ("first sign to no trigger accepted, s", lambda fruit: fruit.safe_s),
        ("fault's end to ready again, s", lambda fruit: None if fruit.remedies else fruit.ready_s),
    )
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    for axes, (title, of) in zip(figure.subplots(1, len(what), sharey=True), what, strict=True):
        for number, link in enumerate(LinkName):
            values = sorted(_values((fruit for fruit in disturbed if fruit.link == link), of))
            if values:
                shares = np.linspace(0.0, 1.0, len(values) + 1)
                axes.step([0.0, *values], shares, where="post", label=link.value, color=f"C{number}")
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xlim(0.0, 10.0)
        axes.set_xlabel(title)
        axes.grid(visible=True, alpha=0.3)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.axes[0].set_ylabel("share of disturbances")
    if handles:
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)
    with mpl.rc_context({"svg.hashsalt": "wire"}):
        figure.savefig(chart, metadata={"Date": None})
