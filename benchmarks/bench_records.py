"""What it costs to make an inspection durable: the station's records beside bare sqlite3, both with synchronous=FULL.

An inspection is a begin, a conclusion with 13 curve points, and the note that it was published: three commits that
somebody waits for. Prints the table and writes docs/records-speed.md. The folder to write in can be given: what is
measured is above all its disk.
"""

import asyncio
import json
import os
import platform
import sqlite3
import statistics
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TypeVar

from station.records.model import CurvePoint, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.recipe import find_recipe
from station.settings.records import RecordsSettings

T = TypeVar("T")

INSPECTIONS = 400
TOGETHER = 16
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "records-speed.md"

CURVE = tuple(CurvePoint(step, 30.0 - step, float(step), 9.0 * step, 12_000 * step, 0.9) for step in range(13))
RECORD = InspectionRecord(
    outcome="PASS",
    reasons=(),
    explanation=("every area was below its limit",),
    late=False,
    partial=False,
    area_mm2=31.5,
    area_px=44_500,
    closing_mm=4.0,
    confidence=0.9,
    ended_utc_ms=1_700_000_003_000,
    duration_ms=3000,
    curve=CURVE,
    phases_s={"approach": 0.8, "steps": 2.1},
    devices={"camera": "DIGIT D20966"},
    versions={"fruit-station": "0.1.0"},
)
TRIGGER = Trigger(
    trigger_id=7,
    encoder=0,
    lot="A-17",
    began_utc_ms=1_700_000_000_000,
    recipe=RecipeSnapshot.of(find_recipe("strawberry").model_dump(mode="json")),
    simulated=True,
)


async def timed(work: Awaitable[T], times_s: list[float]) -> T:
    """Await, and note how long it took."""
    began_s = time.perf_counter()
    result = await work
    times_s.append(time.perf_counter() - began_s)
    return result


async def station(folder: Path, together: int) -> list[str]:
    """The station's records, with so many inspections at a time."""
    records = await Records.open(folder, RecordsSettings(deadline_s=30.0, free_reserve_mb=1), "bench")
    begins_s: list[float] = []
    conclusions_s: list[float] = []

    async def inspections(number: int) -> None:
        for _ in range(number):
            sequence = await timed(records.begin(TRIGGER), begins_s)
            outcome = await timed(records.conclude(sequence, RECORD), conclusions_s)
            await records.published(outcome)

    began_s = time.perf_counter()
    await asyncio.gather(*(inspections(INSPECTIONS // together) for _ in range(together)))
    took_s = time.perf_counter() - began_s
    await records.close()
    name = f"station, {together} at a time" if together > 1 else "station, one after another"
    return row(name, begins_s, conclusions_s, took_s)


def bare(folder: Path) -> list[str]:
    """The same rows by hand: one connection, prepared statements, nothing around them."""
    connection = sqlite3.connect(folder / "bare.sqlite3", isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute(
        "CREATE TABLE inspections (sequence INTEGER PRIMARY KEY, begun TEXT, concluded TEXT, published INT)"
    )
    connection.execute("CREATE TABLE points (sequence INT, step INT, width REAL, closing REAL, area REAL, px INT)")
    begun, concluded = json.dumps([7, 0, "A-17", 1_700_000_000_000]), json.dumps({"outcome": "PASS", "area": 31.5})
    begins_s: list[float] = []
    conclusions_s: list[float] = []
    began_s = time.perf_counter()
    for sequence in range(1, INSPECTIONS + 1):
        first_s = time.perf_counter()
        connection.execute("INSERT INTO inspections VALUES (?, ?, NULL, NULL)", (sequence, begun))
        second_s = time.perf_counter()
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("UPDATE inspections SET concluded = ? WHERE sequence = ?", (concluded, sequence))
        points = [(sequence, p.step, p.width_mm, p.closing_mm, p.area_mm2, p.area_px) for p in CURVE]
        connection.executemany("INSERT INTO points VALUES (?, ?, ?, ?, ?, ?)", points)
        connection.execute("COMMIT")
        conclusions_s.append(time.perf_counter() - second_s)
        begins_s.append(second_s - first_s)
        connection.execute("UPDATE inspections SET published = 1 WHERE sequence = ?", (sequence,))
    took_s = time.perf_counter() - began_s
    connection.close()
    return row("bare sqlite3, one after another", begins_s, conclusions_s, took_s)


def row(name: str, begins_s: list[float], conclusions_s: list[float], took_s: float) -> list[str]:
    """One line of the table."""
    cells = [name]
    for times_s in (begins_s, conclusions_s):
        percentiles = statistics.quantiles(times_s, n=100)
        cells += [f"{1e3 * percentiles[49]:.2f}", f"{1e3 * percentiles[98]:.2f}"]
    return [*cells, f"{len(begins_s) / took_s:.0f}"]


def sync_ms(folder: Path) -> float:
    """What one fsync of a small append costs on this disk, median."""
    times_s = []
    with (folder / "sync").open("wb", buffering=0) as file:
        for _ in range(200):
            began_s = time.perf_counter()
            file.write(bytes(4096))
            os.fsync(file.fileno())
            times_s.append(time.perf_counter() - began_s)
    return 1e3 * statistics.median(times_s)


def main() -> int:
    """Measure, print, and write the document."""
    ways: list[Callable[[Path], list[str]]] = [
        bare,
        lambda folder: asyncio.run(station(folder, 1)),
        lambda folder: asyncio.run(station(folder, TOGETHER)),
    ]
    rows = []
    with tempfile.TemporaryDirectory(dir=sys.argv[1] if len(sys.argv) > 1 else None) as place:
        synced_ms = sync_ms(Path(place))
        for number, way in enumerate(ways):
            folder = Path(place) / str(number)
            folder.mkdir()
            rows.append(way(folder))
    head = ["records", "begin p50, ms", "begin p99, ms", "conclude p50, ms", "conclude p99, ms", "inspections/s"]
    table = "\n".join(f"| {' | '.join(line)} |" for line in [head, ["---"] * len(head), *rows])
    text = (
        "# How long the records take\n\n"
        "`./run bench records` writes this page. An inspection is three commits with `synchronous=FULL`: begin, "
        "conclude with 13\ncurve points, published. A begin of the station also makes the sequence's mark durable, "
        "a second sync.\n\n"
        f"{table}\n\n"
        f"{INSPECTIONS} inspections each; {platform.machine()}, Python {platform.python_version()}, SQLite "
        f"{sqlite3.sqlite_version}; one sync of 4 KiB took {synced_ms:.2f} ms (median).\n"
    )
    print(text)
    DOCUMENT.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
