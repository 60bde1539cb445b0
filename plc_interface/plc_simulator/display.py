"""Display of the PLC simulator: a live table on a terminal, one line per fruit elsewhere."""

from collections import deque
from collections.abc import Callable
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
_COLUMNS = (
    "no.",
    "trigger",
    "record",
    "fruit",
    "area over closing",
    "outcome",
    "area mm²",
    "closing mm",
    "cycle s",
    "reason",
)
_WIDTHS = (4, 7, 6, 20, 17, 9, 8, 10, 7, 0)

Sketch = Callable[[int], str]
"""Gives a result's curve as a short text for its sequence; empty where there is none."""


class LineDisplay:
    """Display of a line's fruit and summary; `sketch` draws each result's curve, if the caller can read it."""

    def __init__(self, console: Console, summary: Summary, sketch: Sketch = lambda _: "") -> None:
        self._console, self._summary, self._sketch = console, summary, sketch
        self._rows: deque[tuple[tuple[str, ...], str]] = deque(maxlen=_ROWS)
        self._activity = ""
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None

    def __enter__(self) -> Self:
        if self._live:
            self._live.start()
        else:
            self._print(_COLUMNS)
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def passed(self, passage: Passage, fruit: LaidFruit) -> None:
        """Show a decided fruit: the line's decision and the fruit's true state."""
        row = _row(passage, fruit, self._sketch(passage.sequence) if passage.sequence else "")
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

    def _print(self, row: tuple[str, ...]) -> None:
        text = "  ".join(cell.ljust(width) for cell, width in zip(row, _WIDTHS, strict=True))
        self._console.out(text.rstrip(), highlight=False)

    def _refresh(self) -> None:
        if self._live is None:
            return
        table = Table(*_COLUMNS)
        for row, style in self._rows:
            outcome = Text(row[5], style)
            table.add_row(*row[:5], outcome, *row[6:])
        self._live.update(Group(table, Text(f"{summary_line(self._summary)}\n{self._activity}")), refresh=True)


def summary_line(summary: Summary) -> str:
    """Return a line's counts in one sentence."""
    counts = ", ".join(f"{count} {decision}" for decision, count in summary.decided.items() if count)
    return (
        f"{summary.fruits} fruits: {counts or 'none decided'}; damaged and passed: {summary.damaged_passed}; "
        f"sound and diverted: {summary.sound_diverted}"
    )


def _row(passage: Passage, fruit: LaidFruit, curve: str) -> tuple[str, ...]:
    reasons = [reason.replace("_", " ") for reason in passage.reasons]
    if passage.fault is not None:
        reasons.append(f"PLC plays {passage.fault.replace('_', ' ')}")
    return (
        str(passage.number),
        str(passage.trigger_id),
        str(passage.sequence or ""),
        f"{fruit.kind}{' (damaged)' if fruit.damaged else ''}" or "not known",
        curve,
        str(passage.decision),
        "" if passage.area_mm2 is None else f"{passage.area_mm2:.1f}",
        "" if passage.closing_mm is None else f"{passage.closing_mm:.2f}",
        f"{passage.cycle_s:.1f}",
        ", ".join(reasons),
    )
