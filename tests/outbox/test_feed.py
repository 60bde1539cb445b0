"""The outbox's feed: the age of its next entry, and its origin where the database is an older copy."""

import asyncio
import shutil
import sqlite3
import time
from contextlib import closing

import pytest
from sqlalchemy import Engine, event

from station.outbox.feed import read_batch
from station.records.audit import AuditEntry, append_audit
from station.records.audit_head import FILE_NAME as HEAD_NAME
from station.records.database import FILE_NAME
from station.records.direct_transaction import direct_transaction
from station.records.lots import end_lot, start_lot
from station.records.records import Records
from station.records.retention import remove_oldest_images
from station.records.short_transaction import short_transaction
from station.settings.records import RecordsSettings

DAY_MS = 86_400_000
IDA = ("Ida", "operator")


def now_ms():
    return time.time_ns() // 1_000_000


@pytest.fixture
def old(fill, tmp_path):
    """Records with an inspection of ten days ago, which has an image."""
    fill(tmp_path, 1, 3, steps=0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database, database:
        database.execute("UPDATE inspections SET published_utc_ms = ?", (now_ms() - 10 * DAY_MS,))
        database.execute("INSERT INTO images (sequence, kind, step, sha256, size_bytes) VALUES (1, 'step', 0, 'ab', 9)")
    return tmp_path


def age_s(folder, after):
    oldest_utc_ms = read_batch(folder, "s", after).oldest_utc_ms
    assert oldest_utc_ms is not None
    return (now_ms() - oldest_utc_ms) / 1000


def test_an_old_inspection_that_changed_now_has_waited_since_now(old):
    last = read_batch(old, "s", 0).last
    assert age_s(old, last - 1) == pytest.approx(864_000, abs=60), "it waits since it was published"
    with short_transaction(old) as connection:
        assert remove_oldest_images(connection, for_accepted=False) == (9, ["ab"])
    changed = read_batch(old, "s", last)
    assert [event.kind for event in changed.events] == ["audit", "inspection"]
    assert age_s(old, last) < 60
    assert age_s(old, last + 1) < 60, "not since it was published"


def test_a_lot_has_waited_since_its_last_change(old):
    with short_transaction(old) as connection:
        start_lot(connection, "A-17", "Meier", IDA)
        connection.exec_driver_sql("UPDATE lots SET began_utc_ms = ? WHERE name = 'A-17'", (now_ms() - DAY_MS,))
        end_lot(connection, "A-17", IDA)
    ended = read_batch(old, "s", 0).last
    assert age_s(old, ended - 1) < 60


def test_what_dates_an_entry_is_found_by_keys_and_not_among_all_entries_ever_made(old):
    plans = []

    def explain(connection, _cursor, statement, parameters, _context, _many):
        if "max(audit.utc_ms)" in statement:
            found = connection.connection.driver_connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
            plans.append([row[3] for row in found])

    event.listen(Engine, "before_cursor_execute", explain)
    try:
        read_batch(old, "s", 0)
    finally:
        event.remove(Engine, "before_cursor_execute", explain)
    (plan,) = plans
    assert any(step.startswith("SEARCH audit USING INTEGER PRIMARY KEY") for step in plan), plan
    assert any(step.startswith("SEARCH outbox USING INTEGER PRIMARY KEY") for step in plan), plan


def start_station(folder):
    """Start a station, and end it."""

    async def steps():
        await (await Records.open(folder, RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")).close()

    asyncio.run(steps())


def by_command(folder, transaction=direct_transaction):
    """Write as a person's command does."""
    with transaction(folder) as connection:
        append_audit(connection, AuditEntry("ada", "quality", "tried", "nothing"))


WRITES = {
    "start of the station": start_station,
    "command": by_command,
    "command beside the station": lambda folder: by_command(folder, short_transaction),
}
"""What may write first."""


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_an_old_copy_put_back_by_hand_has_a_new_origin_from_its_end_on(fill, tmp_path, write):
    folder, copy = tmp_path / "records", tmp_path / "copy"
    fill(folder, 1, 5, steps=0)
    by_command(folder)
    shutil.copyfile(folder / FILE_NAME, copy)
    at_copy = read_batch(folder, "s", 0).last
    fill(folder, 6, 8, steps=0)
    by_command(folder)
    before = read_batch(folder, "s", 0)
    published = {before.lineage[0].id: before.last}
    for name in (FILE_NAME, f"{FILE_NAME}-wal", f"{FILE_NAME}-shm"):
        (folder / name).unlink(missing_ok=True)
    shutil.copyfile(copy, folder / FILE_NAME)
    write(folder)
    fill(folder, 9, 10, steps=0)
    after = read_batch(folder, "s", 0)
    assert after.lineage[0].id not in published
    assert after.known(published) == at_copy
    write(folder)
    assert read_batch(folder, "s", 0).lineage == after.lineage, "and no other one with each write"


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_a_start_and_a_command_leave_the_origin(fill, tmp_path, write):
    fill(tmp_path, 1, 5, steps=0)
    lineage = read_batch(tmp_path, "s", 0).lineage
    write(tmp_path)
    start_station(tmp_path)
    by_command(tmp_path)
    assert read_batch(tmp_path, "s", 0).lineage == lineage


def test_a_lost_head_of_the_audit_trail_costs_the_origin_and_no_entry(fill, tmp_path):
    fill(tmp_path, 1, 5, steps=0)
    start_station(tmp_path)
    before = read_batch(tmp_path, "s", 0)
    (tmp_path / HEAD_NAME).unlink()
    start_station(tmp_path)
    after = read_batch(tmp_path, "s", 0)
    assert [origin.last_entry for origin in after.lineage] == [None, before.last]
    assert after.known({before.lineage[0].id: 3}) == 3
