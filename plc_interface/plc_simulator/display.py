"""Display of the PLC simulator: a live table on a terminal, one line per fruit elsewhere."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from plc_interface.plc_simulator.nest import LaidFruit
from plc_interface.plc_simulator.program import Decision, Passage
from plc_interface.plc_simulator.simulator import Summary

_ROWS = 20
_STYLES = {Decision.PASS: "green", Decision.FAIL: "bold red"}
_OTHERWISE = "yellow"
_OUTCOME, _CURVE = "outcome", "area over closing"
_WIDTHS = {
    "no.": 4,
    "trigger": 7,
    "record": 6,
    "fruit": 20,
    _CURVE: 17,
    _OUTCOME: 9,
    "area mm²": 8,
    "closing mm": 10,
    "cycle s": 7,
    "reason": 0,
}
"""The columns in order, with their widths on what is no terminal."""

Sketch = Callable[[int], str]
"""Gives a result's curve as a short text for its sequence; empty where there is none."""


class LineDisplay:
    """Display of a line's fruit and summary; `sketch` draws each result's curve, if the caller can read it."""

    def __init__(self, console: Console, summary: Summary, sketch: Sketch | None = None) -> None:
        self._console, self._summary, self._sketch = console, summary, sketch
        self._columns = [name for name in _WIDTHS if name != _CURVE or sketch is not None]
        self._rows: deque[tuple[dict[str, str], str]] = deque(maxlen=_ROWS)
        self._activity = ""
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None

    def __enter__(self) -> Self:
        if self._live:
            self._live.start()
        else:
            self._print({name: name for name in self._columns})
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def passed(self, passage: Passage, fruit: LaidFruit) -> None:
        """Show a decided fruit: the line's decision and the fruit's true state."""
        curve = self._sketch(passage.sequence) if self._sketch is not None and passage.sequence else ""
        row = _row(passage, fruit, curve)
        self._rows.append((row, _STYLES.get(passage.decision, _OTHERWISE)))
        if self._live:
            self._refresh()
        else:
            self._print(row)

    def show_activity(self, what: str) -> None:
        """Show the line's activity, one sentence or the program's stage, when it changes."""
        if what != self._activity:
            self._activity = what
            self._refresh()

    def _print(self, row: Mapping[str, str]) -> None:
        text = "  ".join(row[name].ljust(_WIDTHS[name]) for name in self._columns)
        self._console.out(text.rstrip(), highlight=False)

    def _refresh(self) -> None:
        if self._live is None:
            return
        table = Table(*self._columns)
        for row, style in self._rows:
            table.add_row(*(Text(row[name], style if name == _OUTCOME else "") for name in self._columns))
        self._live.update(Group(table, Text(f"{summary_line(self._summary)}\n{self._activity}")), refresh=True)


def summary_line(summary: Summary) -> str:
    """Return a line's counts in one sentence."""
    counts = ", ".join(f"{count} {decision}" for decision, count in summary.decided.items() if count)
    return (
        f"{summary.fruits} fruits: {counts or 'none decided'}; damaged and passed: {summary.damaged_passed}; "
        f"sound and diverted: {summary.sound_diverted}"
    )


def _row(passage: Passage, fruit: LaidFruit, curve: str) -> dict[str, str]:
    """Return the cells of a fruit, by column."""
    reasons = [reason.replace("_", " ") for reason in passage.reasons]
    if passage.fault is not None:
        reasons.append(f"PLC plays {passage.fault.replace('_', ' ')}")
    return {
        "no.": str(passage.number),
        "trigger": str(passage.trigger_id),
        "record": str(passage.sequence or ""),
        "fruit": f"{fruit.kind}{' (damaged)' if fruit.damaged else ''}" or "not known",
        _CURVE: curve,
        _OUTCOME: str(passage.decision),
        "area mm²": "" if passage.area_mm2 is None else f"{passage.area_mm2:.1f}",
        "closing mm": "" if passage.closing_mm is None else f"{passage.closing_mm:.2f}",
        "cycle s": f"{passage.cycle_s:.1f}",
        "reason": ", ".join(reasons),
    }
