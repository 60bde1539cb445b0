"""docs/plc/handshake-table.md: the state table, drawn and printed. `python -m plc_interface.handshake.document`."""

from pathlib import Path

from plc_interface.handshake.modes import Mode
from plc_interface.handshake.table import REGIONS
from plc_interface.handshake.work import Row

Cells = tuple[str, str, str]
"""A row's condition, effects and next mode."""
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "plc" / "handshake-table.md"
_HEAD = """\
# The handshake's table

<!-- Made by python -m plc_interface.handshake.document -->

Reference behind [the handshake](handshake.md): every mode and signal, generated from the code. The regions run in
parallel. A signal goes to each region that lists it; of several rows for one mode and signal, the first whose condition
is true applies. Modes and signals that share a row behave alike. A row without an effect and a next mode lists what is
expected and changes nothing; a pair that is in no row changes nothing, is counted and is logged.
"""


def document() -> str:
    """Return the document: a heading, a diagram and a table for each region."""
    return _HEAD + "".join(_region(region, rows) for region, rows in REGIONS.items())


def _region(region: type[Mode], rows: tuple[Row, ...]) -> str:
    purpose = (region.__doc__ or "").removesuffix(".")
    lines = [f"\n## {region.__name__}: {purpose[0].lower()}{purpose[1:]}\n", *_diagram(rows), *_table(rows)]
    return "\n".join(lines) + "\n"


def _diagram(rows: tuple[Row, ...]) -> list[str]:
    """Return a Mermaid diagram of the mode changes; the first row's mode is the initial one."""
    changes: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.mode is not row.next:
            words = changes.setdefault((_node(row.mode), _node(row.next)), [])
            if row.signal.value not in words:
                words.append(row.signal.value)
    arrows = [f"    {start} --> {end}: {', '.join(words)}" for (start, end), words in changes.items()]
    return ["```mermaid", "stateDiagram-v2", f"    [*] --> {_node(rows[0].mode)}", *arrows, "```", ""]


def _table(rows: tuple[Row, ...]) -> list[str]:
    """Return the table, with one row for all modes and signals that behave alike."""
    behaviours: dict[tuple[Mode, str], list[Cells]] = {}
    for row in rows:
        guard = _phrase(row.guard.__doc__) if row.guard else ""
        effects = "; ".join(_phrase(effect.__doc__) for effect in row.effects)
        after = "" if row.next is row.mode and not row.guard and not effects else row.next.value
        behaviours.setdefault((row.mode, row.signal.value), []).append((guard, effects, after))
    signals: dict[tuple[Mode, tuple[Cells, ...]], list[str]] = {}
    for (mode, signal), behaviour in behaviours.items():
        signals.setdefault((mode, tuple(behaviour)), []).append(signal)
    modes: dict[tuple[tuple[str, ...], tuple[Cells, ...]], list[str]] = {}
    for (mode, behaviour), names in signals.items():
        modes.setdefault((tuple(names), behaviour), []).append(mode.value)
    lines = ["| modes | signals | if | does | next |", "|---|---|---|---|---|"]
    for (names, behaviour), where in modes.items():
        for guard, effects, after in behaviour:
            lines.append(f"| {', '.join(where)} | {', '.join(names)} | {guard} | {effects} | {after} |")
    return lines


def _node(mode: Mode) -> str:
    return mode.value.replace(" ", "_")


def _phrase(docstring: str | None) -> str:
    """Return a docstring's sentence as a part of one; capitals as in PLC and `Begin` are unchanged."""
    words = (docstring or "").removesuffix(".")
    return words if words[1:2].isupper() else words[:1].lower() + words[1:]


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
