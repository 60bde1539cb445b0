"""Cost of the records beside bare sqlite3: a durable inspection, a search among millions, and an export.

An inspection is a begin, a conclusion with 13 curve points, and the note that it was published: three commits that
a caller waits for, with synchronous=FULL. Prints the tables and writes docs/records-speed.md. The folder to write in
can be given: what is measured is above all its disk; 5 million inspections take some 6 GB of it.
"""

import argparse
import asyncio
import csv
import itertools
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

from archive.many import FIRST_UTC_MS, PERIOD_MS, fill, grower_of, made

from station.messages.judge import STOPPED_KEPT
from station.records.database import FILE_NAME, reading
from station.records.export import export
from station.records.model import CurvePoint, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.records.search import Page, Query, find_page
from station.settings.recipe import find_recipe
from station.settings.records import RecordsSettings
from station.vocabulary import Reason

T = TypeVar("T")

INSPECTIONS = 400
TOGETHER = 16
PATIENCE_S = 20.0
EXPORTED = 500_000
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "records-speed.md"

CURVE = tuple(CurvePoint(step, 30.0 - step, float(step), 9.0 * step, 12_000 * step, 0.9) for step in range(13))
RECORD = InspectionRecord(
    outcome="PASS",
    reasons=(),
    explanation=(STOPPED_KEPT(closing_mm=3.0),),
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
    trigger, outcome = json.dumps([7, 0, "A-17", 1_700_000_000_000]), json.dumps({"outcome": "PASS", "area": 31.5})
    begins_s: list[float] = []
    conclusions_s: list[float] = []
    began_s = time.perf_counter()
    for sequence in range(1, INSPECTIONS + 1):
        first_s = time.perf_counter()
        connection.execute("INSERT INTO inspections VALUES (?, ?, NULL, NULL)", (sequence, trigger))
        second_s = time.perf_counter()
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("UPDATE inspections SET concluded = ? WHERE sequence = ?", (outcome, sequence))
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
    """Return the median time of one fsync of a small append on this disk, ms."""
    times_s = []
    with (folder / "sync").open("wb", buffering=0) as file:
        for _ in range(200):
            began_s = time.perf_counter()
            file.write(bytes(4096))
            os.fsync(file.fileno())
            times_s.append(time.perf_counter() - began_s)
    return 1e3 * statistics.median(times_s)


def questions(rows: int) -> dict[str, Query]:
    """Return a quality manager's queries by name, from common ones to those that find nothing."""
    lot, _, _ = made(rows // 2)
    grower, other = grower_of(lot), grower_of(made(rows // 2 + 100_000)[0])
    day = 24 * 3_600_000
    start = FIRST_UTC_MS + rows // 3 * PERIOD_MS
    return {
        "all": Query(),
        "one lot": Query(lot=lot),
        "one lot, FAIL": Query(lot=lot, outcome="FAIL"),
        "one lot, a rare reason": Query(lot=lot, reason=Reason.CAMERA_FAULT),
        "one grower": Query(grower=grower),
        "one grower, FAIL": Query(grower=grower, outcome="FAIL"),
        "one grower, a reason, a week": Query(
            grower=other, reason=Reason.EARLY_STOP, from_utc_ms=start, to_utc_ms=start + 7 * day
        ),
        "one grower, a rare reason": Query(grower=grower, reason=Reason.CAMERA_FAULT),
        "one grower, a reason that never was": Query(grower=grower, reason=Reason.ARM_FAULT),
        "an hour": Query(from_utc_ms=start, to_utc_ms=start + day // 24),
        "a day, NO_RESULT": Query(from_utc_ms=start, to_utc_ms=start + day, outcome="NO_RESULT"),
        "before all others": Query(to_utc_ms=FIRST_UTC_MS + day // 24),
        "NO_RESULT": Query(outcome="NO_RESULT"),
        "a reason": Query(reason=Reason.LOW_CONFIDENCE),
        "a reason and its outcome": Query(reason=Reason.EARLY_STOP, outcome="FAIL"),
        "a rare reason": Query(reason=Reason.CAMERA_FAULT),
        "one fruit": Query(fruit="strawberry"),
        "a rare fruit": Query(fruit="raspberry"),
        "a rare fruit, FAIL": Query(fruit="raspberry", outcome="FAIL"),
        "one fruit, a rare reason": Query(fruit="strawberry", reason=Reason.CAMERA_FAULT),
        "a fruit that never was": Query(fruit="cherry", outcome="FAIL"),
    }


def plain_sql(query: Query) -> tuple[str, list[object]]:
    """The same question as anybody would write it for sqlite3, on the same tables and indexes."""
    conditions = {
        "i.lot = ?": query.lot,
        "i.lot IN (SELECT name FROM lots WHERE grower = ?)": query.grower,
        "i.began_utc_ms >= ?": query.from_utc_ms,
        "i.began_utc_ms < ?": query.to_utc_ms,
        "i.outcome = ?": query.outcome,
        "i.sequence IN (SELECT sequence FROM reasons WHERE reason = ?)": query.reason,
        "i.recipe_sha256 IN (SELECT sha256 FROM recipe_snapshots WHERE name = ?)": query.fruit,
    }
    given = {text: value for text, value in conditions.items() if value is not None}
    where = f"WHERE {' AND '.join(given)}" if given else ""
    return f"SELECT i.sequence FROM inspections AS i {where} ORDER BY i.sequence DESC LIMIT 50", list(given.values())


def pages(folder: Path, rows: int) -> list[list[str]]:
    """Return a row for each query: rows found, times of the first and the slowest page, and of bare sqlite3, ms."""
    table = []
    for name, query in questions(rows).items():
        with reading(folder) as connection:
            page = Page((), None)
            times_s: list[float] = []
            found: list[int] = []
            for _ in range(20):
                began_s = time.perf_counter()
                page = find_page(connection, query, 50, page.below)
                times_s.append(time.perf_counter() - began_s)
                found += [each.sequence for each in page.rows]
                if page.below is None:
                    break
        text, values = plain_sql(query)
        with sqlite3.connect(f"file:{folder / FILE_NAME}?mode=ro", uri=True) as bare_connection:
            until_s = time.perf_counter() + PATIENCE_S
            bare_connection.set_progress_handler(lambda until=until_s: time.perf_counter() > until, 100_000)
            began_s = time.perf_counter()
            try:
                answer = [number for (number,) in bare_connection.execute(text, values)]
            except sqlite3.OperationalError:
                bare_ms = f"over {1e3 * PATIENCE_S:.0f}"
            else:
                bare_ms = f"{1e3 * (time.perf_counter() - began_s):.1f}"
                if answer != found[:50]:
                    raise RuntimeError(f"{name}: another answer than sqlite3's")
        bare_connection.close()
        table.append([name, str(len(found)), f"{1e3 * times_s[0]:.1f}", f"{1e3 * max(times_s):.1f}", bare_ms])
    return table


def exports(folder: Path, rows: int) -> list[list[str]]:
    """Inspections exported in a second."""
    query = Query(to_utc_ms=FIRST_UTC_MS + min(rows, EXPORTED) * PERIOD_MS)
    table = []
    for suffix in (".csv", ".parquet"):
        target = folder / f"export{suffix}"
        began_s = time.perf_counter()
        number = export(folder, query, target)
        took_s = time.perf_counter() - began_s
        table.append(
            [f"station, {suffix[1:]}", str(number), f"{number / took_s:.0f}", f"{target.stat().st_size / 1e6:.0f}"]
        )
    with sqlite3.connect(f"file:{folder / FILE_NAME}?mode=ro", uri=True) as connection:
        target, began_s, number = folder / "bare.csv", time.perf_counter(), 0
        cursor = connection.execute("SELECT * FROM inspections WHERE sequence < ?", (min(rows, EXPORTED),))
        with target.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            while batch := cursor.fetchmany(10_000):
                writer.writerows(batch)
                number += len(batch)
    connection.close()
    rate = number / (time.perf_counter() - began_s)
    table.append(["bare sqlite3, csv, no curves", str(number), f"{rate:.0f}", f"{target.stat().st_size / 1e6:.0f}"])
    return table


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table."""
    return "\n".join(f"| {' | '.join(line)} |" for line in itertools.chain([head, ["---"] * len(head)], rows))


def main() -> int:
    """Measure, print, and write the document."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", nargs="?", help="where to write; the system's temporary folder by default")
    parser.add_argument("--rows", type=int, default=5_000_000, help="among how many inspections is searched")
    arguments = parser.parse_args()
    ways: list[Callable[[Path], list[str]]] = [
        bare,
        lambda folder: asyncio.run(station(folder, 1)),
        lambda folder: asyncio.run(station(folder, TOGETHER)),
    ]
    rows = []
    with tempfile.TemporaryDirectory(dir=arguments.folder) as place:
        synced_ms = sync_ms(Path(place))
        for number, way in enumerate(ways):
            folder = Path(place) / str(number)
            folder.mkdir()
            rows.append(way(folder))
        folder, began_s = Path(place) / "many", time.perf_counter()
        fill(folder, 1, arguments.rows, steps=4)
        filled_s, size_gb = time.perf_counter() - began_s, (folder / FILE_NAME).stat().st_size / 1e9
        found, exported = pages(folder, arguments.rows), exports(folder, arguments.rows)
    text = (
        "# Speed of the records\n\n"
        "`./run bench records` writes this page.\n\n## To write\n\nAn inspection is three commits with "
        "`synchronous=FULL`: begin, conclude with 13 curve points, published.\nA begin of the station also makes the "
        "sequence's mark durable, a second sync.\n\n"
        + markdown(
            ["records", "begin p50, ms", "begin p99, ms", "conclude p50, ms", "conclude p99, ms", "inspections/s"], rows
        )
        + f"\n\n{INSPECTIONS} inspections each; one sync of 4 KiB took {synced_ms:.2f} ms (median).\n\n## To find\n\n"
        f"Pages of 50 among {arguments.rows:,} inspections ({size_gb:.1f} GB, generated in {filled_s:.0f} s), read "
        "with their curves,\nup to 20 pages of each query. Bare sqlite3 gets the same query in plain SQL on "
        "the same tables and indexes, for the\nnumbers of the first page alone, and is given up after "
        f"{PATIENCE_S:g} s; the answers are the same.\n\n"
        + markdown(["query", "found", "first page, ms", "slowest page, ms", "bare sqlite3, ms"], found)
        + "\n\n## To export\n\nWith curves and recipes, in constant memory.\n\n"
        + markdown(["way", "inspections", "inspections/s", "MB"], exported)
        + f"\n\n{platform.machine()}, Python {platform.python_version()}, SQLite {sqlite3.sqlite_version}.\n"
    )
    print(text)
    if arguments.rows >= 5_000_000:
        DOCUMENT.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
