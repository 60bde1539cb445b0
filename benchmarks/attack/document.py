"""The page of the attacks."""

import os
import platform
import statistics
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from .bystanders import ANSWER_S, STOP_S
from .target import Found

LONGEST_P99_MS = 50.0
MOST_GROWN_MB, MOST_FILES_LEFT, BACK_S = 32.0, 8, 60.0
ROOT = Path(__file__).resolve().parents[2]
TITLES = {
    "": "nobody",
    "plc": "Modbus",
    "hmi": "pages, API",
    "tls": "pages, TLS",
    "service": "metrics, health",
}


_HEAD = """\
# Attacks

Written by `./run bench attack`: a demonstration with fruit after fruit, in a network of its own. Beside each attack,
processes of their own: a Modbus client that reads 20 registers at a 10 ms scan, and a panel where an operator is logged
in, which orders *Stop* and *Start* over and over, each on new connections. Attackers have other addresses than both,
unless the row says otherwise. What is defended against whom: [Security](security.md)."""
_HOLDS = f"""\
A row holds if the attack gets what it has to get; each scan has its answer within {1000 * ANSWER_S:g} ms, and 99 %
within {LONGEST_P99_MS:g} ms; each *Stop* is carried out within {STOP_S:g} s; {BACK_S:g} s after the attack the
attacked process has at most {MOST_GROWN_MB:g} MB and {MOST_FILES_LEFT} descriptors more than before."""
_COLUMNS = """\
| on | attack | tries | what came of it | scans answered | errors | p50, ms | p99, ms | max, ms | *Stop* carried out \
| median, s | max, s | memory before, most, after, MB | descriptors likewise | holds |
|---|---|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|---|---|---|"""
_AGAIN = """\
## Again

`./run bench attack` writes this page; it needs `unshare`, `ip`, `openssl` and the right to make a network namespace.
`--seconds N` is for longer attacks; `--small` for short ones and `--only WORD` for those whose row has that word, both
without this page. In small these attacks are tests: `tests/hmi/test_doors.py`, `tests/hmi/test_security.py`,
`tests/plc_interface/server/`. What a PLC that has the right to write may repeat: [the handshake](plc/handshake.md)."""


class Process(NamedTuple):
    """The attacked process before, at its most, and afterwards."""

    before_mb: float
    most_mb: float
    after_mb: float
    before_files: int
    most_files: int
    after_files: int
    ended: bool


class Row(NamedTuple):
    """One attack's result."""

    on: str
    name: str
    found: Found
    took_ms: Sequence[float]
    """Of the Modbus client's answers."""
    errors: int
    stop_s: Sequence[float]
    """Of each *Stop* that was carried out."""
    stops_failed: int
    process: Process

    @property
    def p99_ms(self) -> float:
        """Of the Modbus client."""
        return sorted(self.took_ms)[int(0.99 * len(self.took_ms))] if self.took_ms else float("inf")

    @property
    def wrong(self) -> list[str]:
        """Faults seen during and after the attack, in words; empty if there are none."""
        process = self.process
        grown_mb, left = process.after_mb - process.before_mb, process.after_files - process.before_files
        faults = (
            (bool(self.found.wrong), self.found.wrong),
            (self.errors > 0, f"{self.errors} scans without an answer"),
            (self.p99_ms > LONGEST_P99_MS, "p99 is too long"),
            (self.stops_failed > 0, f"*Stop* not carried out {self.stops_failed} times"),
            (not self.stop_s, "no *Stop* was carried out"),
            (process.ended, "the process ended"),
            (grown_mb > MOST_GROWN_MB, f"{grown_mb:.0f} MB more than before"),
            (left > MOST_FILES_LEFT, f"{left} descriptors more than before"),
        )
        return [what for so, what in faults if so]


def markdown(rows: Sequence[Row], seconds: float, load: tuple[float, float]) -> str:
    """Return the page.

    Args:
        rows: the first without an attack.
        seconds: of each attack.
        load: of the machine, before the first and after the last.
    """
    held = sum(not row.wrong for row in rows)
    conditions = (
        f"{seconds:g} s for each attack, or its tries. Commit {_commit()}; Python {platform.python_version()}; "
        f"{os.cpu_count()} cores that station, twin, PLC, attackers and other work share; load of the machine "
        f"{load[0]:.1f} before the first attack and {load[1]:.1f} after the last. Latencies are therefore upper bounds."
    )
    result = f"**{held} of {len(rows)} rows hold.** {_HOLDS}"
    return "\n\n".join([_HEAD, result, "\n".join([_COLUMNS, *map(_line, rows)]), _AGAIN, conditions]) + "\n"


def _line(row: Row) -> str:
    process, stops = row.process, len(row.stop_s)
    cells = (
        TITLES[row.on],
        row.name,
        f"{row.found.tries:,}" if row.found.tries else "",
        row.found.seen,
        f"{len(row.took_ms):,}",
        str(row.errors),
        f"{statistics.median(row.took_ms):.2f}" if row.took_ms else "",
        f"{row.p99_ms:.1f}",
        f"{max(row.took_ms, default=0.0):.1f}",
        f"{stops} of {stops + row.stops_failed}",
        f"{statistics.median(row.stop_s):.2f}" if stops else "",
        f"{max(row.stop_s):.2f}" if stops else "",
        f"{process.before_mb:.0f}, {process.most_mb:.0f}, {process.after_mb:.0f}",
        f"{process.before_files}, {process.most_files}, {process.after_files}",
        f"**no**: {'; '.join(row.wrong)}" if row.wrong else "yes",
    )
    return f"| {' | '.join(cells)} |"


def _commit() -> str:
    command = ["git", "log", "-1", "--format=of %cs"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"
