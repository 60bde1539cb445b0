"""Three stations publish inspections to one PostgreSQL, while it is stopped, killed, and its connections are cut.

Run with `./run bench outbox`: of 100,000 inspections none may be missing, doubled or out of order afterwards. Beside
it, in the same run: the same events by psycopg's executemany, without any of that. Writes docs/outbox-speed.md. Exits 1
where something is wrong.
"""

import argparse
import asyncio
import contextlib
import json
import platform
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Literal

from archive.many import fill
from archive.postgres import PORT, Server, programs, throwaway

from station.outbox.feed import json_text, read_batch
from station.outbox.postgresql import Postgresql
from station.outbox.publisher import Publisher
from station.settings.outbox import OutboxPostgresqlSettings

STATIONS = 3
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "outbox-speed.md"
TROUBLES = 3
_LIMIT_S = 900.0


def total(server: Server) -> int:
    """Count the inspections that have arrived; 0 while the server is away, as their number is unknown then."""
    with contextlib.suppress(Exception), server.connect() as connection:
        found = connection.execute("SELECT count(*) FROM inspections").fetchone()
        return found[0] if found else 0
    return 0


async def trouble(server: Server) -> dict[str, int]:
    """Disturb the server so often; it runs at the end."""
    done = {"cut": 0, "crashed": 0, "stopped": 0}
    ways: tuple[tuple[Literal["fast", "immediate"], str], ...] = (("immediate", "crashed"), ("fast", "stopped"))
    for how, name in ways * TROUBLES:
        for _ in range(3):
            await asyncio.sleep(random.uniform(0.2, 1.5))
            done["cut"] += await asyncio.to_thread(server.cut)
        await asyncio.to_thread(server.stop, how)
        done[name] += 1
        await asyncio.sleep(random.uniform(0.0, 0.5))
        await asyncio.to_thread(server.start)
    return done


async def arrival(server: Server, wanted: int) -> None:
    """Wait until all have arrived."""
    until_s = time.monotonic() + _LIMIT_S
    while (arrived := await asyncio.to_thread(total, server)) < wanted:
        if time.monotonic() > until_s:
            raise TimeoutError(f"{arrived} of {wanted} arrived within {_LIMIT_S:g} s")
        await asyncio.sleep(0.2)


async def publish_under_trouble(server: Server, home: Path, rows: int) -> tuple[float, dict[str, int]]:
    """Write and publish at the same time, under trouble; return the time it took, s, and the count of each trouble."""
    settings = OutboxPostgresqlSettings(enabled=True, host=str(server.folder), port=PORT, user="fruit", tls="disable")
    each = rows // STATIONS
    names = [f"station-{number}" for number in range(STATIONS)]
    for name in names:
        fill(home / name, 1, each // 2, steps=4)
    publishers = [Publisher(home / name, name, Postgresql(settings, name), longest_pause_s=1.0) for name in names]
    began_s = time.perf_counter()
    running = [asyncio.create_task(publisher.run()) for publisher in publishers]
    try:
        writing = [asyncio.to_thread(fill, home / name, each // 2 + 1, each, 4) for name in names]
        troubled = asyncio.create_task(trouble(server))
        await asyncio.gather(*writing, troubled)
        done = troubled.result()
        await arrival(server, each * STATIONS)
    finally:
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
    return time.perf_counter() - began_s, done


def verify(server: Server, rows: int) -> dict[str, int]:
    """Count each kind of fault in what arrived: all 0 if nothing is wrong."""
    each = rows // STATIONS
    questions = {
        "missing": f"SELECT {each * STATIONS} - count(DISTINCT (station, sequence)) FROM inspections",
        "doubled": "SELECT count(*) - count(DISTINCT (station, sequence)) FROM inspections",
        "out of order": "SELECT count(*) FROM (SELECT entry < lag(entry) OVER (PARTITION BY station ORDER BY arrived) "
        "AS early FROM inspections) AS told WHERE early",
        "refused": "SELECT count(*) FROM refused",
    }
    with server.connect() as connection:
        found = {name: connection.execute(query).fetchone() for name, query in questions.items()}  # pyrefly: ignore[no-matching-overload] (constants above)
    return {name: row[0] for name, row in found.items() if row}


def bare(server: Server, folder: Path, rows: int) -> float:
    """The same events by hand: executemany into a table of two columns, one commit a batch; s."""
    began_s = time.perf_counter()
    with server.connect() as connection, connection.cursor() as cursor:
        cursor.execute("CREATE TABLE bare (entry bigint PRIMARY KEY, data jsonb)")
        position = 0
        while position < rows:
            batch = read_batch(folder, "bare", position)
            with connection.transaction():
                rows_of_batch = [(event.entry, json_text(event.data)) for event in batch.events]
                cursor.executemany("INSERT INTO bare VALUES (%s, %s) ON CONFLICT DO NOTHING", rows_of_batch)
            position = batch.up_to
    return time.perf_counter() - began_s


def undisturbed(server: Server, folder: Path, rows: int) -> float:
    """One station alone publishes all it has; s."""
    settings = OutboxPostgresqlSettings(enabled=True, host=str(server.folder), port=PORT, user="fruit", tls="disable")

    async def publish_all() -> None:
        async with Postgresql(settings, "alone").connected() as session:
            position = 0
            while position < rows:
                batch = read_batch(folder, "alone", position)
                await session.publish(batch)
                position = batch.up_to

    began_s = time.perf_counter()
    asyncio.run(publish_all())
    return time.perf_counter() - began_s


def main() -> int:
    """Measure, verify, print, and write the document."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--json", action="store_true", help="only the run under trouble, as JSON; writes no document")
    arguments = parser.parse_args()
    bin_folder = programs()
    if bin_folder is None:
        print("PostgreSQL's programs are missing: apt-get install postgresql", file=sys.stderr)
        return 1
    rows = arguments.rows // STATIONS * STATIONS
    with tempfile.TemporaryDirectory() as place, throwaway(bin_folder) as server:
        took_s, done = asyncio.run(publish_under_trouble(server, Path(place), rows))
        wrong = verify(server, rows)
        if arguments.json:
            print(json.dumps({"rows": rows, "done": done, "wrong": wrong}))
            return 1 if any(wrong.values()) else 0
        some, folder = rows // STATIONS, Path(place) / "station-0"
        alone_s, bare_s = undisturbed(server, folder, some), bare(server, folder, some)
        text = (
            "# Speed of the outbox\n\n"
            f"`./run bench outbox` writes this page. {STATIONS} stations, {rows} inspections with 4 curve points "
            f"each, one PostgreSQL. Half of\nthem are written while others are published; during this time the "
            f"server is disturbed at random moments.\n\n"
            f"| done to the server | times |\n| --- | --- |\n| connections cut | {done['cut']} |\n"
            f"| crashed (stopped with `immediate`) | {done['crashed']} |\n| stopped orderly | {done['stopped']} |\n\n"
            "| found afterwards | inspections |\n| --- | --- |\n"
            + "".join(f"| {name} | {number} |\n" for name, number in wrong.items())
            + f"\nAll had arrived after {took_s:.0f} s.\n\n"
            f"| one station, undisturbed, {some} inspections | inspections/s |\n| --- | --- |\n"
            f"| outbox: COPY, then typed columns, idempotent | {some / alone_s:.0f} |\n"
            f"| bare psycopg: the same JSON by executemany | {some / bare_s:.0f} |\n\n"
            f"Server and stations on one machine: {platform.machine()}, Python {platform.python_version()}. A station "
            "makes some 0.3 inspections/s.\n"
        )
    print(text)
    DOCUMENT.write_text(text, encoding="utf-8")
    return 1 if any(wrong.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
