"""A station that writes is killed (SIGKILL) at random moments, and what it had acknowledged is looked for.

Run with `./run bench kills`: 1,000 kills; `--rounds N` for others. Three fruits are under way at a time, with images
that push each other out of a small quota, and a row of the audit trail for each. Afterwards: no acknowledged trigger,
outcome or audit row is missing, none is there twice, the database is sound, and every image has its row and every row
its image. Writes docs/records-kills.md. Exits 1 where something is wrong.
"""

import argparse
import asyncio
import itertools
import json
import os
import platform
import random
import select
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import closing
from pathlib import Path
from typing import Literal

import numpy as np
from reliability.kills import Restarts, check_station, kill_in_round
from reliability.kills_page import Made, Round, Station, markdown
from reliability.rig import running
from reliability.scenario import Expected, Scenario
from sqlalchemy import select as select_rows

from station.records.audit import GENESIS, AuditEntry, row_of
from station.records.database import FILE_NAME, reading
from station.records.images import FOLDER_NAME
from station.records.integrity_check import check_records
from station.records.model import CurvePoint, Image, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.records.schema import audit
from station.settings.records import RecordsSettings

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "records-kills.md"
WIRE_DOCUMENT = DOCUMENT.with_name("kills.md")
WIRE_KILLS = Path(__file__).resolve().parent / "reliability" / "kills.json"
ROUNDS_A_STATION = 20
LIMIT_MM2 = 50.0
"""Limit between a sound and a bruised fruit of the twin."""
SIDE_BY_SIDE = 3
"""A station waits most of the time: some use the machine better."""
SETTINGS = RecordsSettings(deadline_s=30.0, free_reserve_mb=1, images_quota_mb=1)
STEPS = 8
MOST_LINES = 24
LONGEST_S = 0.05
"""A station is killed within this time after one of so many acknowledgements."""
_SILENT_S = 60.0


def acknowledge(*words: object) -> None:
    """Acknowledge, at once or not at all: a line this short is written whole."""
    os.write(1, (json.dumps(words) + "\n").encode())


async def fruit(records: Records, tag: int, pixels: np.ndarray) -> None:
    """One inspection; every answer of the records is acknowledged before the next request."""
    trigger = Trigger(7, tag, f"lot {tag % 5}", 5, RecipeSnapshot("r", 3, "", "{}"), simulated=True)
    sequence = await records.begin(trigger)
    acknowledge("begun", sequence, tag)
    images = (Image("reference", None, pixels), Image("step", 0, pixels[::-1].copy()))
    curve = tuple(CurvePoint(step, 30.0, None, 1.0, 1, 0.5) for step in range(STEPS))
    record = InspectionRecord(
        "FAIL", ("no_contact",), (), late=False, partial=False, area_mm2=None, area_px=None, closing_mm=None,
        confidence=None, ended_utc_ms=9, duration_ms=4, curve=curve, images=images,
    )  # fmt: skip
    outcome = await records.conclude(sequence, record)
    acknowledge("concluded", sequence, tag)
    await records.published(outcome)
    acknowledge("published", sequence, tag)
    (row,) = await records.audit(AuditEntry("tester", "quality", "fruit.seen", f"inspection {sequence}"))
    acknowledge("audited", row.seq, tag)


async def station(folder: Path, round_number: int) -> None:
    """Inspect until killed."""
    records = await Records.open(folder, SETTINGS, f"boot {round_number}")
    noise = np.random.default_rng()
    tags = iter(range(round_number * 10_000, (round_number + 1) * 10_000))
    while True:
        made = [noise.integers(0, 256, (32, 32, 3), dtype=np.uint8) for _ in range(3)]
        await asyncio.gather(*(fruit(records, next(tags), pixels) for pixels in made))


def one_kill(folder: Path, round_number: int) -> list[list[object]]:
    """Start a station, kill it, and give what it had acknowledged."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        os.dup2(writer, 1)
        asyncio.run(station(folder, round_number))
        os._exit(1)
    os.close(writer)
    output = b""
    lines = random.randrange(MOST_LINES) if random.random() < 0.9 else 0  # one in ten in the middle of its start
    until_s = time.monotonic() + _SILENT_S
    while output.count(b"\n") < lines and time.monotonic() < until_s and select.select([reader], [], [], _SILENT_S)[0]:
        output += os.read(reader, 65_536)
    time.sleep(random.uniform(0.0, LONGEST_S))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(reader, "rb") as pipe:
        output += pipe.read()
    return [json.loads(line) for line in output.splitlines()]


async def opened_once(folder: Path) -> None:
    """A start that puts right what a kill left, and ends in order."""
    records = await Records.open(folder, SETTINGS, "orderly")
    await records.close()


def verify(folder: Path, acks: dict[str, dict[int, int]], repeated: int) -> dict[str, int]:
    """Count each kind of loss or fault in the records after the kills: all 0 if nothing is wrong."""
    wrong: Counter[str] = Counter({"numbers given twice": repeated})
    found = check_records(folder)
    with closing(sqlite3.connect(folder / FILE_NAME)) as database:
        rows = dict(database.execute("SELECT sequence, encoder FROM inspections"))
        wrong["acknowledged triggers missing"] = sum(rows.get(number) != tag for number, tag in acks["begun"].items())
        wrong["triggers recorded twice"] = len(rows) - len(set(rows.values()))
        query = "SELECT i.sequence FROM inspections AS i WHERE judged = 'FAIL' AND (SELECT count(*) FROM curve_points "
        judged = {row for (row,) in database.execute(f"{query} WHERE sequence = i.sequence) = {STEPS}")}
        wrong["acknowledged outcomes missing"] = len(acks["concluded"].keys() - judged)
        query = "SELECT sequence FROM inspections WHERE published_utc_ms NOT NULL AND outcome = 'FAIL'"
        wrong["published outcomes missing"] = len(
            acks["published"].keys() - {row for (row,) in database.execute(query)}
        )
        query = "SELECT row FROM outbox WHERE kind = 'inspection'"
        wrong["published outcomes not in the outbox"] = len(
            acks["published"].keys() - {r for (r,) in database.execute(query)}
        )
        query = "SELECT count(*) FROM inspections WHERE outcome IS NULL"
        wrong["without an outcome after the last start"] = database.execute(query).fetchone()[0]
        rows_of_images = {sha256 for (sha256,) in database.execute("SELECT sha256 FROM images")}
    files = {file.stem for file in (folder / FOLDER_NAME).glob("*/*")}
    wrong["images without a row"] = len(files - rows_of_images)
    wrong["rows without an image"] = len(rows_of_images - files)
    wrong["faults of the database or of an image"] = len(found.faults)
    with reading(folder) as connection:
        trail = [row_of(row) for row in connection.execute(select_rows(audit).order_by(audit.c.seq))]
    wrong["acknowledged audit rows missing"] = len(acks["audited"].keys() - {row.seq for row in trail})
    before = [GENESIS, *(row.hash for row in trail)]
    broken = (row.hash != row.true_hash or row.previous_hash != last for row, last in zip(trail, before, strict=False))
    wrong["broken links of the audit trail"] = sum(broken)
    return dict(wrong)


async def rounds_of_one_station(seed: int, number: int) -> AsyncIterator[Round | Station]:
    """Kill in one station, round after round, until it does not come back or often enough; then check its records.

    What a station with something wrong leaves is not removed, and its place printed.
    """
    placings: tuple[Literal["nest", "arm"], ...] = ("nest", "arm", "arm", "arm")
    chance, scenario = random.Random(seed), Scenario(name="kills", fault=None, expected=Expected(outcomes=("PASS",)))
    placing, place = chance.choice(placings), Path(tempfile.mkdtemp())
    kills, wrong, restarts = 0, False, Restarts()
    async with running(place, scenario, placing, LIMIT_MM2) as rig:
        for each in range(ROUNDS_A_STATION):
            made = await kill_in_round(rig, chance, restarts, seed, each)
            kills, wrong = kills + len(made.kills), bool(made.wrong)
            print(made.model_dump_json(), flush=True)
            yield made
            if wrong or kills >= number:
                break
    station = check_station(rig.records, seed)
    print(station.model_dump_json(), flush=True)
    yield station
    if wrong or station.wrong:
        print(f"what it left: {place}", flush=True)
    else:
        shutil.rmtree(place)


async def kill_over_the_wire(number: int, seed: int | None) -> bool:
    """Make so many kills, and the page of all. Whether nothing was wrong."""
    if seed is not None:
        return not [made.wrong async for made in rounds_of_one_station(seed, number) if made.wrong]
    made = Made.model_validate_json(WIRE_KILLS.read_text()) if WIRE_KILLS.exists() else Made()
    before, seeds = made, itertools.count(1 + max((each.seed for each in made.rounds), default=0))

    async def one_after_the_other() -> None:
        nonlocal made
        while (left := number - (made.kills - before.kills)) > 0:
            async for each in rounds_of_one_station(next(seeds), left):
                if isinstance(each, Round):
                    made = Made(rounds=(*made.rounds, each), stations=made.stations)
                else:
                    made = Made(rounds=made.rounds, stations=(*made.stations, each))
                WIRE_KILLS.write_text(made.model_dump_json(indent=0) + "\n")
                WIRE_DOCUMENT.write_text(markdown(made), encoding="utf-8")

    await asyncio.gather(*(one_after_the_other() for _ in range(SIDE_BY_SIDE)))
    return made.bad == before.bad


def main() -> int:
    """Kill, verify, print, and write the document."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--wire", type=int, metavar="N", help="kill processes of a whole station instead")
    parser.add_argument("--seed", type=int, help="with --wire: of the one station to repeat")
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--json", action="store_true", help="print JSON; write no document")
    arguments = parser.parse_args()
    if arguments.wire is not None:
        return 0 if asyncio.run(kill_over_the_wire(arguments.wire, arguments.seed)) else 1
    acks: dict[str, dict[int, int]] = {"begun": {}, "concluded": {}, "published": {}, "audited": {}}
    repeated, began_s = 0, time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "records"
        asyncio.run(opened_once(folder))  # so that each station is forked with all that it needs loaded
        for number in range(arguments.rounds):
            for word, row, tag in one_kill(folder, number):
                repeated += row in acks[str(word)]
                acks[str(word)][int(str(row))] = int(str(tag))
        asyncio.run(opened_once(folder))
        wrong = verify(folder, acks, repeated)
        took_s = time.perf_counter() - began_s
    if arguments.json:
        print(
            json.dumps(
                {"rounds": arguments.rounds, "told": {word: len(rows) for word, rows in acks.items()}, "wrong": wrong}
            )
        )
        return 1 if any(wrong.values()) else 0
    text = (
        "# A station killed a thousand times\n\n"
        "`./run bench kills` writes this page: a station that writes three fruits at a time is killed (SIGKILL) at a "
        "random moment,\none time in ten while it starts. A sample is part of every test run.\n\n"
        "| acknowledged before a kill | |\n| --- | --- |\n"
        f"| kills | {arguments.rounds} |\n| triggers | {len(acks['begun'])} |\n"
        f"| outcomes | {len(acks['concluded'])} |\n| outcomes recorded as published | {len(acks['published'])} |\n"
        f"| rows of the audit trail | {len(acks['audited'])} |\n\n"
        "| wrong afterwards | |\n| --- | --- |\n"
        + "".join(f"| {what} | {count} |\n" for what, count in wrong.items())
        + f"\n{took_s:.0f} s; {platform.machine()}, Python {platform.python_version()}, "
        f"SQLite {sqlite3.sqlite_version}.\n"
    )
    print(text)
    DOCUMENT.write_text(text, encoding="utf-8")
    return 1 if any(wrong.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
