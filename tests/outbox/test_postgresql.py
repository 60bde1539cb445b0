"""Rows reach a real PostgreSQL once each and in order, whether it is cut off, crashed or stopped meanwhile."""

import asyncio
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psycopg
import pytest

from station.messages.records import IMAGES_KEPT, IMAGES_NOT_WANTED
from station.outbox.errors import OutboxError
from station.outbox.feed import read_batch
from station.outbox.postgresql import Postgresql
from station.records.audit import AuditEntry, append_audit
from station.records.backup import make_backup
from station.records.database import FILE_NAME
from station.records.direct_transaction import direct_transaction
from station.records.lots import end_lot, start_lot
from station.records.restore import restore_backup
from station.records.short_transaction import short_transaction
from station.records.signing import public_keys_of
from station.records.write_requests import queue_event
from station.settings.outbox import OutboxPostgresqlSettings

LIMIT_S = 90.0
IDA = ("Ida", "operator")


def settings(server, **changes):
    usual: dict[str, Any] = {
        "enabled": True, "host": str(server.folder), "port": 5432, "user": "fruit", "tls": "disable"
    }  # fmt: skip
    return OutboxPostgresqlSettings(**(usual | changes))


def rows(server, query, *values):
    with server.connect() as connection:
        return connection.execute(query, values).fetchall()


async def publish_all(server, folder, station):
    """Publish until nothing waits; return the number of entries."""
    count = 0
    async with Postgresql(settings(server), station).connected() as session:
        position = await session.position(read_batch(folder, station, 0))
        while (batch := read_batch(folder, station, position)).up_to > position:
            await session.publish(batch)
            count, position = count + len(batch.events), batch.up_to
    return count


def test_three_stations_lose_and_double_nothing_while_the_server_is_cut_crashed_and_stopped(
    postgresql_programs,
):
    """15,000 inspections; `./run bench outbox` does it with 100,000."""
    program = Path(__file__).resolve().parents[2] / "benchmarks" / "bench_outbox.py"
    done = subprocess.run(
        [sys.executable, program, "--rows", "15000", "--json"], capture_output=True, text=True, timeout=110, check=False
    )
    assert done.stdout, done.stderr[-2000:]
    report = json.loads(done.stdout)
    assert report["wrong"] == {"missing": 0, "doubled": 0, "out of order": 0, "refused": 0}
    assert report["done"]["cut"] > 0
    assert report["done"]["crashed"] == report["done"]["stopped"] == 3


def test_an_inspection_a_lot_and_an_audit_row_arrive_as_they_are(server, fill, tmp_path):
    fill(tmp_path, 1, 3, steps=4)
    with short_transaction(tmp_path) as connection:
        connection.exec_driver_sql(
            "UPDATE inspections SET fruit_length_mm_x10 = 481, size_class = 3 WHERE sequence = 1"
        )
        start_lot(connection, "A\N{LATIN SMALL LETTER U WITH DIAERESIS}", "Meier", IDA)
        end_lot(connection, "A\N{LATIN SMALL LETTER U WITH DIAERESIS}", IDA)
        append_audit(connection, AuditEntry("ada", "quality", "tried", "nothing", "to see", {"a": 1}, [2]))
    assert asyncio.run(publish_all(server, tmp_path, "as-they-are")) == 3 + 1 + 3, (
        "a lot's start and end are in the trail"
    )
    query = "SELECT lot, outcome, reasons, area_mm2, fruit, jsonb_array_length(curve), began::text FROM inspections"
    first, *_ = rows(server, f"{query} WHERE station = 'as-they-are' ORDER BY sequence")
    assert first == ("L00000", "PASS", [], 21.0, "raspberry", 4, "2026-01-01 00:00:03+00")
    sizes = rows(
        server, "SELECT fruit_length_mm, size_class FROM inspections WHERE station = 'as-they-are' ORDER BY sequence"
    )
    assert sizes[:2] == [(48.1, 3), (None, None)]
    ((grower, ended, revision),) = rows(server, "SELECT grower, ended, revision FROM lots WHERE name = 'Aü'")
    assert (grower, revision, ended is None) == ("Meier", 2, False)
    query = "SELECT who, old, new, hash FROM audit WHERE station = 'as-they-are' AND action = 'tried'"
    ((who, old, new, digest),) = rows(server, query)
    with sqlite3.connect(tmp_path / FILE_NAME) as database:
        assert (digest,) == database.execute("SELECT hash FROM audit ORDER BY seq DESC").fetchone()
    database.close()
    assert (who, old, new) == ("ada", '{"a":1}', "[2]")
    assert asyncio.run(publish_all(server, tmp_path, "as-they-are")) == 0, "the server knows the last entry that it has"


def test_a_row_that_changed_is_told_again_and_is_there_once(server, fill, tmp_path):
    fill(tmp_path, 1, 2, steps=0)
    asyncio.run(publish_all(server, tmp_path, "changed"))
    with short_transaction(tmp_path) as connection:
        connection.exec_driver_sql("UPDATE inspections SET images_state = 'kept' WHERE sequence = 2")
        queue_event(connection, "inspection", 2)
    asyncio.run(publish_all(server, tmp_path, "changed"))
    found = rows(server, "SELECT sequence, images_state FROM inspections WHERE station = 'changed' ORDER BY sequence")
    assert found == [(1, str(IMAGES_NOT_WANTED())), (2, str(IMAGES_KEPT()))]


def test_what_no_database_can_hold_is_kept_apart_and_nothing_waits_behind_it(server, fill, tmp_path):
    fill(tmp_path, 1, 4, steps=0)
    with sqlite3.connect(tmp_path / FILE_NAME) as database:
        database.execute("UPDATE inspections SET lot = 'nul' || char(0) || 'inside' WHERE sequence = 1")
        database.execute("UPDATE inspections SET trigger_id = 5000000000 WHERE sequence = 2")
        database.execute("UPDATE inspections SET began_utc_ms = 9000000000000000 WHERE sequence = 3")
    database.close()
    with short_transaction(tmp_path) as connection:
        start_lot(connection, "long", "Meier", IDA)
        start_lot(connection, "west", "Huber", IDA)
        longer = random.Random(3).randbytes(3000).hex()  # than an index takes: an earlier version stored it
        connection.exec_driver_sql("UPDATE lots SET grower = ? WHERE name = 'long'", (longer,))
    asyncio.run(publish_all(server, tmp_path, "odd"))
    found = rows(server, "SELECT sequence, lot FROM inspections WHERE station = 'odd' ORDER BY sequence")
    assert found == [(1, "nul\N{REPLACEMENT CHARACTER}inside"), (3, "L00000"), (4, "L00000")]
    query = "SELECT kind, data::jsonb->>'name', entry, error FROM refused WHERE station = 'odd' ORDER BY entry"
    (kind, _, entry, why), (other_kind, name, _, other_why) = rows(server, query)
    assert (kind, entry) == ("inspection", 2)
    assert "out of range" in why
    assert (other_kind, name) == ("lot", "long")
    assert "index row" in other_why
    assert rows(server, "SELECT name, grower FROM lots WHERE station = 'odd'") == [("west", "Huber")]


def test_after_a_restoring_numbers_given_again_are_told(server, fill, tmp_path):
    folder, copy = tmp_path / "records", tmp_path / "copy"
    fill(folder, 1, 5, steps=0)
    make_backup(folder, copy)
    fill(folder, 6, 8, steps=0)
    asyncio.run(publish_all(server, folder, "restored"))
    restore_backup(folder, copy, "ada", public_keys_of(folder))
    fill(folder, 9, 10, steps=0)
    count = asyncio.run(publish_all(server, folder, "restored"))
    assert count == 1 + 2, "the restoring itself, two inspections, and not all from the first again"
    found = rows(server, "SELECT sequence FROM inspections WHERE station = 'restored' ORDER BY sequence")
    assert [number for (number,) in found] == [*range(1, 11)]


def test_after_an_old_copy_was_put_back_by_hand_its_numbers_given_again_are_published(server, fill, tmp_path):
    folder, copy = tmp_path / "records", tmp_path / "copy"

    def audit():
        with direct_transaction(folder) as connection:
            append_audit(connection, AuditEntry("ada", "quality", "tried", "nothing"))

    fill(folder, 1, 5, steps=0)
    audit()
    shutil.copyfile(folder / FILE_NAME, copy)
    fill(folder, 6, 8, steps=0)
    audit()
    asyncio.run(publish_all(server, folder, "put-back"))
    for name in (FILE_NAME, f"{FILE_NAME}-wal", f"{FILE_NAME}-shm"):
        (folder / name).unlink(missing_ok=True)
    shutil.copyfile(copy, folder / FILE_NAME)
    audit()
    fill(folder, 9, 10, steps=0)
    count = asyncio.run(publish_all(server, folder, "put-back"))
    assert count == 2 + 2, "that the trail continues, its next row, two inspections, and not all from the first again"
    found = rows(server, "SELECT sequence FROM inspections WHERE station = 'put-back' ORDER BY sequence")
    assert [number for (number,) in found] == [*range(1, 11)]


def test_a_connection_that_is_cut_while_there_is_nothing_to_tell_is_noticed(server):
    async def steps():
        async with Postgresql(settings(server), "idle").connected() as session:
            await session.idle(0.01)
            server.cut()
            await session.idle(LIMIT_S)

    began_s = time.monotonic()
    with pytest.raises(OutboxError, match="terminating connection"):
        asyncio.run(steps())
    assert time.monotonic() - began_s < LIMIT_S, "noticed, not waited for"


def test_the_server_too_notices_that_a_station_was_cut_off(server):
    """Until then the session of before keeps the station's name."""

    async def steps():
        async with Postgresql(settings(server, host=server.address), "cut-off").connected() as session:
            query = "SELECT name, setting FROM pg_settings WHERE name LIKE 'tcp_%'"
            assert dict(await (await session._connection.execute(query)).fetchall()) == {
                "tcp_keepalives_idle": "10",
                "tcp_keepalives_interval": "5",
                "tcp_keepalives_count": "3",
                "tcp_user_timeout": "20000",
            }

    asyncio.run(steps())


def test_two_processes_cannot_tell_as_one_station(server):
    async def steps():
        async with Postgresql(settings(server), "one").connected():
            with pytest.raises(OutboxError, match="another process publishes as one; wait a minute where this"):
                async with Postgresql(settings(server), "one").connected():
                    pass

    asyncio.run(steps())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"database": "postgres"}, "has no tables of the station; load deploy/postgresql/schema.sql there"),
        ({"host": "/nowhere"}, "see the server and the outbox's settings"),
        ({"user": "stranger"}, 'role "stranger" does not exist'),
    ],
)
def test_what_is_wrong_is_said(server, changes, message):
    async def steps():
        async with Postgresql(settings(server, **changes), "wrong").connected():
            pass

    with pytest.raises(OutboxError, match=message):
        asyncio.run(steps())


FORM = (
    (
        "SELECT table_name, column_name, data_type, is_nullable FROM information_schema.columns "
        "WHERE table_schema = 'public' ORDER BY 1, 2"
    ),
    (
        "SELECT grantee, table_name, privilege_type FROM information_schema.role_table_grants "
        "WHERE table_schema = 'public' AND grantee LIKE 'fruit%' ORDER BY 1, 2, 3"
    ),
    "SELECT event_object_table, trigger_name, event_manipulation FROM information_schema.triggers ORDER BY 1, 2, 3",
    "SELECT proname, prosrc FROM pg_proc WHERE pronamespace = 'public'::regnamespace ORDER BY 1",
    "SELECT indexdef FROM pg_indexes WHERE schemaname = 'public' ORDER BY 1",
    "SELECT version FROM schema_version",
)
SUMMARIES = ("hourly_outcomes", "hourly_reasons", "hourly_values")


def summaries_of(connection, station):
    """One station's summaries: another test's rows may be of inspections that it has deleted."""
    return [
        connection.execute(f"SELECT * FROM {name} WHERE station = %s ORDER BY 1, 2, 3, 4, 5, 6", (station,)).fetchall()
        for name in SUMMARIES
    ]


def test_a_database_of_version_1_is_refused_with_the_remedy_which_makes_it_as_a_new_one(server, fill, tmp_path):
    """Version 1 is the present one without the fruit's size and the summaries by hour."""
    folder = Path(__file__).resolve().parents[2]
    steps = ("deploy/postgresql/schema-1-to-2.sql", "deploy/postgresql/schema-2-to-3.sql")
    fill(tmp_path, 1, 1500, steps=0)
    asyncio.run(publish_all(server, tmp_path, "upgraded"))
    with server.connect() as owner:
        owner.execute("CREATE DATABASE old TEMPLATE fruit")
    try:
        with psycopg.connect(host=str(server.folder), user="fruit", dbname="old", autocommit=True) as old:
            new = [old.execute(query).fetchall() for query in FORM]
            summaries = summaries_of(old, "upgraded")
            old.execute("DROP FUNCTION summarise_inspections() CASCADE; DROP FUNCTION bin_of")
            old.execute("DROP VIEW hourly_outcomes_of_growers, inspections_of_growers")
            old.execute("DROP TABLE hourly_outcomes, hourly_reasons, hourly_values")
            old.execute("DROP INDEX audit_without_seals")
            old.execute("ALTER TABLE inspections DROP COLUMN fruit_length_mm, DROP COLUMN size_class")
            old.execute(
                "CREATE VIEW inspections_of_growers AS SELECT i.*, l.grower FROM inspections i "
                "LEFT JOIN lots l ON l.station = i.station AND l.name = i.lot"
            )
            old.execute("UPDATE schema_version SET version = 1")

            async def connect():
                async with Postgresql(settings(server, database="old"), "old").connected():
                    pass

            with pytest.raises(OutboxError, match=f"version is 1, not 3; load {steps[0]} and then {steps[1]} there"):
                asyncio.run(connect())
            for step in steps:
                old.execute((folder / step).read_bytes())
            asyncio.run(connect())
            upgraded = [old.execute(query).fetchall() for query in FORM]
            assert upgraded == new
            assert summaries_of(old, "upgraded") == summaries
            old.execute("UPDATE schema_version SET version = 4")
            with pytest.raises(OutboxError, match="schema version is 4, not 3; bring this station to the version"):
                asyncio.run(connect())
    finally:
        with server.connect() as owner:
            owner.execute("DROP DATABASE old WITH (FORCE)")


def test_a_station_may_add_to_the_trail_and_not_change_it(server, fill, tmp_path):
    """The rights that the schema gives a station's login are enough, and no more."""
    with server.connect() as connection:
        connection.execute("CREATE ROLE limited LOGIN IN ROLE fruit_station")
    fill(tmp_path, 1, 2, steps=0)
    with short_transaction(tmp_path) as connection:
        append_audit(connection, AuditEntry("ada", "quality", "tried", "nothing"))

    async def steps():
        async with Postgresql(settings(server, user="limited"), "limited").connected() as session:
            await session.publish(read_batch(tmp_path, "limited", 0))

    asyncio.run(steps())
    assert rows(server, "SELECT count(*) FROM audit WHERE station = 'limited'") == [(1,)]
    refused = psycopg.errors.InsufficientPrivilege
    with psycopg.connect(host=str(server.folder), user="limited", dbname="fruit") as mine, pytest.raises(refused):
        mine.execute("UPDATE audit SET who = 'nobody'")


def test_the_process_tells_says_how_far_and_ends_in_order(server, fill, tmp_path, command):
    fill(tmp_path / "records", 1, 40, steps=1)
    site = {
        "STATION_OUTBOX_STATION": "by-process",
        "STATION_OUTBOX_POSTGRESQL_ENABLED": "true",
        "STATION_OUTBOX_POSTGRESQL_HOST": str(server.folder),
        "STATION_OUTBOX_POSTGRESQL_USER": "fruit",
        "STATION_OUTBOX_POSTGRESQL_TLS": "disable",
    }
    environment = {**os.environ, "STATION_HOME": str(tmp_path), **site}
    arguments = [sys.executable, "-m", "station", "outbox", "run"]
    with subprocess.Popen(arguments, env=environment, stdout=-3, stderr=-1, text=True) as process:
        until_s = time.monotonic() + LIMIT_S
        query = "SELECT count(*) FROM inspections WHERE station = 'by-process'"
        while rows(server, query) != [(40,)] and time.monotonic() < until_s:
            time.sleep(0.1)
        assert rows(server, query) == [(40,)]
        done = command("outbox", "status", **site)
        while "40 published, 0 wait" not in done.stdout and time.monotonic() < until_s:
            done = command("outbox", "status", **site)
        assert "postgresql: 40 published, 0 wait, 0 refused; connected" in done.stdout
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT_S) == 0
