"""Triggers over the wire: mixed fruit, sixty of each and more, and whether every book tells the same of each one.

The line simulator triggers the real station (its service, PLC interface and arm driver, each a process) against the
twin. What the PLC read is compared with the records and the metrics, and with the twin's truth. Writes
docs/triggers.md.
"""

import asyncio
import math
import os
import platform
import statistics
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from prometheus_client.parser import text_string_to_metric_families
from sorting import tables

from plc_interface.plc_simulator.nest import LaidFruit, TwinNest
from plc_interface.plc_simulator.program import Decision, LineProgram, Passage
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.commands.simulated_unit import calibrate_simulated_unit
from station.records.database import reading, records_folder
from station.records.queries import read_inspection
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Supervisor

TRIGGERS, DAMAGED_SHARE, SEED, SEVERITY = 394, 0.5, 2026, "severe"
"""So many are drawn until there are 60 sound and 60 damaged ones of each fruit."""
KINDS = ("strawberry", "raspberry", "blueberry")
CONSOLE_PORT = 49_311
HOST = "127.0.0.83"
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "triggers.md"
CONFIGURATION = f"""
modbus: {{port: 5920}}
metrics: {{port: 9808}}
hmi: {{port: 8808}}
arm: {{host: {HOST}}}
gripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}, answer_timeout_s: 1.0}}
camera: {{oldest_s: 1.0, twin: {{port: 5930}}}}
"""

Row = tuple[Passage, LaidFruit]


class Run(NamedTuple):
    """Decisions of a line, and the waiting times of its fruit."""

    rows: list[Row]
    counted: dict[str, float]
    """The metrics' counts by outcome at the end."""
    waits_s: list[float]
    """How long each fruit waited before the nest."""
    took_s: float


async def inspect(
    site: Configuration,
    count: int,
    kinds: Sequence[str] = KINDS,
    damaged_share: float = DAMAGED_SHARE,
    every_s: float = 0.0,
) -> Run:
    """Run the line with fruit of some kinds, drawn at random.

    Args:
        site: of the cell.
        count: fruit.
        kinds: of fruit.
        damaged_share: of the fruit, 0 to 1.
        every_s: time from one arrival to the next; 0 for as fast as the station takes them.
    """
    numbers = {name: recipe.plc_number for name, recipe in load_recipes(site.recipes_folder).items()}
    nest = TwinNest(CONSOLE_PORT, {kind: numbers[kind] for kind in kinds}, damaged_share, SEED, severity=SEVERITY)
    logs = site.home / "logs"
    logs.mkdir()
    supervisor = Supervisor([twin_program(None, CONSOLE_PORT, SEED, logs), *station_programs(None, logs)])
    ended, ready = asyncio.Event(), asyncio.Event()
    supervising = asyncio.create_task(supervisor.run(ready.set, ended))
    rows: list[Row] = []

    def passed(passage: Passage, fruit: LaidFruit) -> None:
        rows.append((passage, fruit))
        why = ", ".join(passage.reasons)
        print(f"{len(rows):4} of {count}: {fruit.kind} {passage.decision} {why}", file=sys.stderr)

    try:
        async with asyncio.timeout(120):
            await ready.wait()
        order = WordOrder(site.modbus.word_order)
        async with Scanner(site.modbus.host, site.modbus.port, site.modbus.unit, order) as scanner:
            simulator = LineSimulator(LineProgram(lot="BENCH"), scanner, nest, Pace(every_s=every_s))
            simulator.on_passage = passed
            began_s = time.monotonic()
            await simulator.run(count)
            took_s = time.monotonic() - began_s
        text = await asyncio.to_thread(scrape, f"http://{site.metrics.host}:{site.metrics.port}/metrics")
    finally:
        ended.set()
        await supervising
    counted: Counter[str] = Counter()
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            if sample.name == "station_inspections_total":
                counted[sample.labels["outcome"]] += int(sample.value)
    return Run(rows, dict(counted), simulator.summary.waits_s, took_s)


def scrape(url: str) -> str:
    """The metrics' page."""
    with urllib.request.urlopen(url, timeout=10) as answer:
        return answer.read().decode()


def disagreements(site: Configuration, rows: list[Row], counted: dict[str, float]) -> list[str]:
    """Return the disagreements between the PLC, the records and the metrics, in words."""
    wrong = []
    folder = records_folder(site.home)
    seen: set[int] = set()
    with reading(folder) as connection:
        for passage, _ in rows:
            if not passage.sequence:
                continue
            if passage.sequence in seen:
                wrong.append(f"sequence {passage.sequence} came twice")
            seen.add(passage.sequence)
            record = read_inspection(connection, passage.sequence, folder)
            standing = record.standing
            if standing is None or record.acknowledged_utc_ms is None:
                wrong.append(f"sequence {passage.sequence}: not published or not acknowledged in the records")
            elif (standing.outcome, standing.trigger_id, sorted(standing.reasons)) != (
                passage.decision,
                passage.trigger_id,
                sorted(passage.reasons),
            ):
                wrong.append(
                    f"sequence {passage.sequence}: {standing.outcome} in the records, {passage.decision} at the PLC"
                )
            elif not same(standing.area_mm2, passage.area_mm2):
                wrong.append(f"sequence {passage.sequence}: {standing.area_mm2} and {passage.area_mm2} mm²")
    decided = Counter(str(passage.decision) for passage, _ in rows if passage.sequence)
    if dict(decided) != counted:
        wrong.append(f"the metrics count {counted}, the PLC {dict(decided)}")
    return wrong


def same(recorded: float | None, read: float | None) -> bool:
    """Equal as far as a binary32 register can show."""
    if recorded is None or read is None:
        return recorded is read
    return math.isclose(recorded, read, rel_tol=1e-6)


def table(rows: list[Row], kinds: Sequence[str] = KINDS) -> str:
    """Outcomes by kind and truth."""
    lines = ["| fruit | truth | PASS | FAIL | NO_RESULT | refused or no answer |", "|---|---|---|---|---|---|"]
    for kind in kinds:
        for damaged in (False, True):
            found = Counter(p.decision for p, fruit in rows if fruit.kind == kind and fruit.damaged is damaged)
            rest = found[Decision.REFUSED] + found[Decision.NO_ANSWER]
            cells = (found[Decision.PASS], found[Decision.FAIL], found[Decision.NO_RESULT], rest)
            lines.append(f"| {kind} | {'damaged' if damaged else 'sound'} | {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def errors(rows: list[Row], kinds: Sequence[str] = KINDS) -> str:
    """Both errors by kind: sound fruit diverted, damaged ones passed."""
    lines = tables.header("fruit", "sound diverted", f"{SEVERITY} damage passed")
    for kind in kinds:
        sound, damaged = (
            [p.diverted for p, fruit in rows if fruit.kind == kind and fruit.damaged is damaged]
            for damaged in (False, True)
        )
        passed = len(damaged) - sum(damaged)
        lines.append(tables.row(kind, tables.share_of(sum(sound), len(sound)), tables.share_of(passed, len(damaged))))
    return "\n".join(lines)


def reasons(rows: list[Row]) -> str:
    """Return a table of the reasons why sound fruit was diverted."""
    found = Counter(
        (fruit.kind, ", ".join(reason.replace("_", " ") for reason in passage.reasons) or str(passage.decision))
        for passage, fruit in rows
        if fruit.damaged is False and passage.diverted
    )
    lines = ["| fruit | reasons | sound fruit diverted |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {kind} | {why} | {number} |" for (kind, why), number in sorted(found.items()))])


def page(rows: list[Row], wrong: list[str], took_s: float) -> str:
    """The document."""
    cycles_s = [passage.cycle_s for passage, _ in rows if passage.sequence]
    passed = sum(fruit.damaged is True and not passage.diverted for passage, fruit in rows)
    agreement = "none" if not wrong else "\n" + "\n".join(f"- {line}" for line in wrong)
    return f"""# {len(rows)} triggers over the wire

Written by `./run bench triggers`. The line simulator triggers the station's own processes against the twin; the fruit
is drawn at random, {DAMAGED_SHARE:.0%} of it damaged, and the recipe is changed over Modbus wherever the kind changes.
The unit is calibrated, and the line sends each length as a grader has it, to ± 1 mm. In brackets the share's 95 %
interval (Wilson); milder damage and a patch, by the same procedure and judge: [both errors](sorting.md).

{errors(rows)}

{table(rows)}

- Damaged fruit that got PASS: **{passed}**.
- Differences between the PLC's readings, the records (outcome, id, reasons, area) and the metrics' counts:
  **{agreement}**.
- From trigger to decision as the PLC sees it: median {statistics.median(cycles_s):.1f} s, 95th percentile
  {statistics.quantiles(cycles_s, n=20)[18]:.1f} s; the whole run {took_s / 60:.0f} minutes, with recipe changes.

{reasons(rows)}

The damage is simulated (*{SEVERITY}*): flesh that is softer and flatter where the gel touches. The limits were chosen
on the same twin, so the page shows that the whole chain works, and not that real damage is detected. Machine:
{os.cpu_count()} cores, {platform.machine()}, load average {os.getloadavg()[2]:.1f} over the last 15 minutes.
"""


def main() -> None:
    """Run, compare, write."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else TRIGGERS
    with tempfile.TemporaryDirectory() as home:
        file = Path(home) / "station.yaml"
        file.write_text(CONFIGURATION, encoding="utf-8")
        os.environ |= {"STATION_HOME": home, "STATION_CONFIG": str(file)}
        site = load_configuration()
        calibrate_simulated_unit(site, "bench")
        run = asyncio.run(inspect(site, count))
        wrong = disagreements(site, run.rows, run.counted)
    text = page(run.rows, wrong, run.took_s)
    print(text)
    if len(sys.argv) == 1:
        DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
