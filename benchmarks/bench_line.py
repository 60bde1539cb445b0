"""A line at a fixed pace: two hundred fruit of each kind arrive every few seconds, whatever the station does.

Run with `./run bench line [--a-minute 18] [--count 200]`. The line simulator triggers the real station over Modbus
against the twin, by the shipped recipes. A fruit that the nest is not free for waits before it, and the next ones
behind it. Writes `docs/line-pace.md`.
"""

import argparse
import asyncio
import os
import statistics
import tempfile
from pathlib import Path

from bench_triggers import CONFIGURATION, KINDS, Run, disagreements, inspect, reasons, table

from plc_interface.plc_simulator.program import Decision
from station.commands.simulated_unit import calibrate_simulated_unit
from station.settings.configuration import load_configuration

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "line-pace.md"
DAMAGED_SHARE = 0.1
"""An estimate, on the high side: damaged fruit are pressed twice more often, and so take longer."""


def at_pace(kind: str, a_minute: float, count: int) -> tuple[Run, list[str]]:
    """Run a line with one kind of fruit; and where the books differ."""
    with tempfile.TemporaryDirectory() as home:
        file = Path(home) / "station.yaml"
        file.write_text(CONFIGURATION, encoding="utf-8")
        os.environ |= {"STATION_HOME": home, "STATION_CONFIG": str(file)}
        site = load_configuration()
        calibrate_simulated_unit(site, "bench")
        run = asyncio.run(inspect(site, count, (kind,), DAMAGED_SHARE, 60 / a_minute))
        return run, disagreements(site, run.rows, run.counted)


def row(kind: str, run: Run, wrong: list[str], a_minute: float) -> str:
    """One kind's line of the table."""
    lost = sum(passage.decision in {Decision.REFUSED, Decision.NO_ANSWER} for passage, _ in run.rows)
    late = sum("late" in passage.reasons for passage, _ in run.rows)
    cycles_s = [passage.cycle_s for passage, _ in run.rows if passage.sequence]
    queue = max(run.waits_s) * a_minute / 60
    cells = (
        kind,
        f"{len(run.rows)}",
        f"{60 * len(run.rows) / run.took_s:.1f}",
        f"{lost}",
        f"{late}",
        f"{len(wrong)}",
        f"{statistics.median(cycles_s):.2f}, {statistics.quantiles(cycles_s, n=20)[18]:.2f}",
        f"{statistics.median(run.waits_s):.1f}, {max(run.waits_s):.1f}",
        f"{queue:.0f}",
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Run each kind, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--a-minute", type=float, default=18.0, help="fruit that arrive in a minute")
    parser.add_argument("--count", type=int, default=200, help="fruit of each kind")
    options = parser.parse_args()
    runs = {kind: at_pace(kind, options.a_minute, options.count) for kind in KINDS}
    names = (
        "fruit",
        "arrived",
        "decided a minute",
        "refused or no answer",
        "late",
        "differences",
        "to decision, s: median, 95th percentile",
        "wait in front of the nest, s: median, longest",
        "longest queue",
    )
    rows = [row(kind, run, wrong, options.a_minute) for kind, (run, wrong) in runs.items()]
    pace_table = "\n".join([f"| {' | '.join(names)} |", "|---" * len(names) + "|", *rows])
    every_row = [each for run, _ in runs.values() for each in run.rows]
    text = f"""# A line at {options.a_minute:g} fruit a minute

Written by `./run bench line`. Fruit arrive every {60 / options.a_minute:.1f} s, {DAMAGED_SHARE:.0%} of them damaged,
and are inspected by the shipped recipes. If the nest is not free, a fruit waits in front of it: one that is centred
or pressed twice may take longer than the pace, and others take less. *Differences* are those between the PLC's
readings, the records and the metrics. On the twin; unverified on hardware.

{pace_table}

What was decided:

{table(every_row)}

{reasons(every_row)}

Machine: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}.
"""
    print(text)
    DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
