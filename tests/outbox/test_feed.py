"""Age of the outbox's next entry: counted from the last change of its inspection or lot."""

import sqlite3
import time
from contextlib import closing

import pytest
from sqlalchemy import Engine, event

from station.outbox.feed import read_batch
from station.records.database import FILE_NAME
from station.records.lots import end_lot, start_lot
from station.records.retention import remove_oldest_images
from station.records.short_transaction import short_transaction

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
