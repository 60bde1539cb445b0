"""Summary of all benchmarks: their figures beside their peers', read from the pages that they write.

`docs/benchmarks.md` has no figure of its own, so that it cannot disagree with a page. When a benchmark ran, and for how
long, is in `benchmarks/runs.json`, which the runner writes.
"""

import contextlib
import json
import re
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "benchmarks.md"
RUNS = Path(__file__).with_name("runs.json")
BENCHMARKS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("figures.toml").read_text("utf-8"))
LOAD = re.compile(
    r"\b[Ll]oad(?: average)?(?: of(?: the machine)?)? (\d+(?:\.\d+)?)|cores: ([\d.]+ to [\d.]+)|programs took (\d+ %)"
)
"""How pages state the machine's load: an average, its range, or what other programs took of the cores."""
INTRODUCTION = """\
# Benchmarks

`./run bench` runs all of them but the long ones, one after the other, and writes this page; `--all` runs the long ones
too, `--list` lists them, `./run bench NAME [OPTIONS]` runs one. Every figure is read from the page that its benchmark
wrote. Its peers are from the same run, so that the machine's speed on another day makes no difference. A load is the
average number of processes that use or wait for a core, or other programs' share of the cores, before or during the
run.
"""


def find(text: str, columns: set[str], row: str, column: str) -> str:
    """Return the cell of the one row that begins so, among a page's tables that have all these columns.

    Raises:
        LookupError: there is no such row, or more than one.
    """
    found = []
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        header, *rows = ([each.strip() for each in line.strip("|").split("|")] for line in table.splitlines())
        if columns <= set(header):
            found += [cells[header.index(column)] for cells in rows if f"{' | '.join(cells)} |".startswith(row)]
    if len(found) != 1:
        raise LookupError(f"{len(found)} rows begin with {row!r} in tables with the columns {sorted(columns)}")
    return found[0]


def load(text: str) -> str:
    """Return the load that a page states, in its words; empty where it states none."""
    stated = LOAD.search(re.sub(r"\s+", " ", text))
    return next(filter(None, stated.groups())) if stated else ""


def figure(text: str, what: str, column: str, row: str, *peers: str) -> list[str]:
    """Return what is measured, ours, and its peers' with their names, from a page's text."""
    named = [(name, *place.partition(" @ ")[::2]) for name, _, place in (peer.partition(" = ") for peer in peers)]
    columns = {column, *(other for _, _, other in named if other)}
    theirs = [f"{name} {find(text, columns, where, other or column)}" for name, where, other in named]
    return [what, find(text, columns, row, column), "; ".join(theirs)]


def section(text: str, *of: str) -> str:
    """Return a page's section that a figure is in: parts made on other days state other loads; else the whole page."""
    for each in re.split(r"(?m)^(?=## )", text):
        with contextlib.suppress(LookupError):
            figure(each, *of)
            return each
    return text


def markdown(runs: dict[str, dict[str, Any]]) -> str:
    """Return `docs/benchmarks.md` from the pages as they are.

    Args:
        runs: by benchmark its last whole run: `date`, `commit`, `minutes`, `load`.

    Raises:
        LookupError: a page lacks a figure.
    """
    figures = ["| benchmark | | measured | peers in the same run | load |"]
    pages = ["| benchmark | page | last whole run | commit | minutes | load before |"]
    for table in figures, pages:
        table.append("|---" * (table[0].count("|") - 1) + "|")
    for name, entry in BENCHMARKS.items():
        page, ran = entry["page"], runs.get(name, {"date": "not recorded"})
        text = (ROOT / "docs" / page).read_text("utf-8")
        stated = load(text) or str(ran.get("load", "not stated"))
        for each in entry.get("figures", ()):
            try:
                cells = [f"[{name}]({page})", *figure(text, *each), load(section(text, *each)) or stated]
            except LookupError as error:
                raise LookupError(f"docs/{page}: {error}") from error
            figures.append(f"| {' | '.join(cells)} |")
        cells = [f"`{name}`{', long' if entry.get('long') else ''}", f"[{page.rpartition('/')[2]}]({page})"]
        cells += [str(ran.get(each, "")) for each in ("date", "commit", "minutes", "load")]
        pages.append(f"| {' | '.join(cells)} |")
    return "\n".join([INTRODUCTION, "## Beside their peers\n", *figures, "\n## Pages\n", *pages]) + "\n"


def read_runs() -> dict[str, dict[str, Any]]:
    """Return the last whole run of each benchmark."""
    return json.loads(RUNS.read_text("utf-8")) if RUNS.exists() else {}


def write() -> None:
    """Renew `docs/benchmarks.md`."""
    DOCUMENT.write_text(markdown(read_runs()), encoding="utf-8")


if __name__ == "__main__":
    write()
