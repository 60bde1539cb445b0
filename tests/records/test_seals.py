"""Concluded inspections are sealed; what the station itself does to them afterwards is no fault."""

import asyncio
import json
import sqlite3
from dataclasses import replace

import pytest
from sqlalchemy import delete, insert, select, update

from station.channel.line import Reason
from station.messages import records as messages
from station.records.database import FILE_NAME, open_engine, plain
from station.records.schema import audit, curve_points, images, inspections, metadata
from station.records.seals import append_skipped, begin_seals, check_seals, note_skipped, part_hash, seal
from tests.stored_inspection import read_record

UNEXPLAINED = "and the audit trail does not say why"


@pytest.fixture
def rows(tmp_path):
    """An empty database, in a write transaction."""
    engine = open_engine(tmp_path / FILE_NAME, "rwc")
    with engine.begin() as connection:
        metadata.create_all(connection)
        yield connection


def add(connection, sequence, *parts):
    """Add an inspection with a curve's point and an image, and seal parts of it."""
    columns = {"boot": "b", "trigger_id": 7, "encoder": 12, "lot": "Blåbär", "recipe_number": 1, "recipe_checksum": 2,
               "simulated": True, "began_utc_ms": 1, "images_state": "", "outcome": "PASS", "standing": "{}",
               "judged": "PASS"}  # fmt: skip
    connection.execute(insert(inspections).values(sequence=sequence, **columns))
    connection.execute(insert(curve_points).values(sequence=sequence, step=0, width_mm=30.5, flags=[]))
    connection.execute(insert(images).values(sequence=sequence, kind="step", step=0, sha256="ab", size_bytes=9))
    seal(connection, sequence, *parts)


def trail(connection):
    """Return action, subject and new value of the audit trail's rows."""
    found = connection.execute(select(audit.c.action, audit.c.subject, audit.c.new).order_by(audit.c.seq))
    return [(action, subject, json.loads(new)) for action, subject, new in found]


def test_what_the_station_does_itself_is_no_fault(
    opened, scenario, folder, trigger, passed, failed, noise, settled, run_records
):
    """Images make room, an outcome is another one than was judged, a trigger is withdrawn, a start ends what ran."""

    async def steps():
        async with opened(images_quota_mb=1) as records:
            for number in range(4):  # an image is 0.3 MB, so that 3 fit
                record = replace(failed, images=(noise(side_px=320, step=number),))
                await records.published(await records.conclude(await records.begin(trigger), record))
                await settled(records)
            assert read_record(records, 1).images_state == messages.IMAGES_REMOVED()
            outcome = await records.conclude(await records.begin(trigger), passed)
            late = outcome.model_copy(update={"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True})
            await records.published(late)
            gone = asyncio.create_task(records.begin(trigger))
            await asyncio.sleep(0)
            gone.cancel()
            await records.begin(trigger)
            result = await asyncio.to_thread(run_records, "check")
            assert (result.exit_code, "fault" in result.output) == (0, False), result.output
        async with opened() as records:
            assert len(records.lost) == 1
            await records.acknowledged(7)

    scenario(steps)
    result = run_records("check")
    assert result.exit_code == 0, result.output
    assert "note" not in result.output


def test_inspections_of_before_the_seals_are_noted_and_later_ones_sealed(
    opened, scenario, folder, trigger, passed, run_records
):
    async def inspect(number):
        async with opened() as records:
            for _ in range(number):
                await records.published(await records.conclude(await records.begin(trigger), passed))

    scenario(lambda: inspect(3))
    connection = sqlite3.connect(folder / FILE_NAME)  # as the version before left it
    connection.execute("PRAGMA foreign_keys = ON")
    for name in ("audit_no_update", "audit_no_delete", "audit_only_after"):
        connection.execute(f"DROP TRIGGER {name}")
    connection.execute("DELETE FROM audit")
    connection.execute("DELETE FROM inspections WHERE sequence = 2")
    connection.execute("DROP INDEX ix_audit_without_seals")
    connection.execute("UPDATE alembic_version SET version_num = '0008'")
    refused = "SELECT RAISE(ABORT, 'the audit trail only grows: its rows are never changed or removed')"
    connection.execute(f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN {refused}; END")
    connection.execute(f"CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN {refused}; END")
    connection.execute(
        "CREATE TRIGGER audit_only_after BEFORE INSERT ON audit WHEN NEW.seq <= (SELECT max(seq) FROM audit) "
        f"BEGIN {refused}; END"
    )
    connection.commit()
    connection.close()
    for name in ("audit_head", "signing_key.pem", "public_key.pem"):
        (folder / name).unlink()
    result = run_records("check")
    assert result.exit_code == 0, result.output
    assert "note: none of 2 inspections is sealed: they are of an earlier version" in result.output
    scenario(lambda: inspect(1))
    result = run_records("check")
    assert result.exit_code == 0, result.output
    assert "note: inspection 2 is missing, of before the seals" in result.output
    assert "note: 2 inspections up to number 3 are of an earlier version, and not sealed" in result.output
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute("UPDATE inspections SET area_mm2 = 1 WHERE sequence = 4")
    connection.commit()
    connection.close()
    assert "fault: inspection 4: record changed" in run_records("check").output


def test_an_inspection_that_the_station_did_not_make_is_found(opened, scenario, folder, trigger, passed, run_records):
    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), passed))

    scenario(steps)
    connection = sqlite3.connect(folder / FILE_NAME)
    columns = [name for (_, name, *_) in connection.execute("PRAGMA table_info(inspections)") if name != "sequence"]
    names = ", ".join(columns)
    connection.execute(f"INSERT INTO inspections (sequence, {names}) SELECT 2, {names} FROM inspections")
    connection.commit()
    connection.close()
    output = run_records("check").output
    assert "fault: inspection 2: record not sealed" in output
    assert "fault: inspection 2: outcome not sealed" in output


def test_rows_that_a_killed_station_did_not_sign_are_noted_by_the_next_start(
    opened, scenario, folder, trigger, run_records
):
    async def steps(number):
        async with opened() as records:
            for _ in range(number):
                await records.begin(trigger)

    scenario(lambda: steps(1))
    before = (folder / "audit_head").read_bytes()
    scenario(lambda: steps(0))  # ends the inspection that ran, and seals its outcome
    (folder / "audit_head").write_bytes(before)
    result = run_records("check")
    assert result.exit_code == 1
    assert "the signed head does not name them" in result.output
    scenario(lambda: steps(0))
    result = run_records("check")
    assert result.exit_code == 0, result.output
    assert "without a signed head, as a killed station leaves" in result.output


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        ("record", "65da5d6de12d3e2bd2b2d3316448ac1eec3b33e35e64f83a8bc2d95933b24ce5"),
        ("outcome", "bfba951ca7625005bcdc8432fea88d6d0bfadcdaaf2fa0f3a63d4ad9937b24e9"),
        ("images", "ec0f193a8ebe54966166b8364069aaf036b0a9b8772a4d948cde6f5ed2b6ee6f"),
    ],
)
def test_a_seal_is_the_hash_that_earlier_versions_stored(rows, part, expected):
    add(rows, 1, part)
    assert trail(rows) == [("inspection.sealed", "inspection 1", {part: expected})]
    assert part_hash(plain(rows), 1, part) == expected
    assert part_hash(plain(rows), 2, part) is None


def test_the_seals_begin_once_for_each_key(rows):
    for highest, key in ((3, "aa"), (4, "aa"), (5, "bb"), (6, "bb"), (7, "aa")):
        begin_seals(rows, highest, key)
    assert trail(rows) == [
        ("seals.began", "records", {"after": highest, "public_key": key})
        for highest, key in ((3, "aa"), (5, "bb"), (7, "aa"))
    ]


@pytest.mark.parametrize(
    ("before", "sequence", "noted"),
    [
        ((), 1, []),
        ((1,), 2, []),
        ((1,), 3, [("2", {"from": 2, "to": 2})]),
        ((), 4, [("1-3", {"from": 1, "to": 3})]),
        ((1, 2), 6, [("3-5", {"from": 3, "to": 5})]),
    ],
)
def test_numbers_without_an_inspection_are_noted_by_the_next(rows, before, sequence, noted):
    for each in before:
        add(rows, each, "record")
    note_skipped(rows, sequence)
    assert trail(rows)[len(before) :] == [("numbers.skipped", subject, new) for subject, new in noted]


@pytest.mark.parametrize(
    ("sequences", "skipped", "faults"),
    [
        ((1, 2, 3), (), []),
        ((1, 3), (), [f"inspection 2 is missing, {UNEXPLAINED}"]),
        ((1, 2, 5), (), [f"inspections 3 to 4 are missing, {UNEXPLAINED}"]),
        ((1, 5), ((2, 4),), []),
        ((1, 5), ((1, 5),), []),
        ((1, 5), ((2, 3),), [f"inspections 2 to 4 are missing, {UNEXPLAINED}"]),
        ((1, 5), ((3, 4),), [f"inspections 2 to 4 are missing, {UNEXPLAINED}"]),
    ],
)
def test_missing_numbers_are_a_fault_unless_the_trail_explains_them(rows, sequences, skipped, faults):
    begin_seals(rows, 0, "aa")
    for sequence in sequences:
        add(rows, sequence, "record", "outcome", "images")
    for first, last in skipped:
        append_skipped(rows, first, last)
    assert check_seals(rows) == (faults, [])


def test_missing_numbers_of_before_the_seals_are_noted_up_to_the_last(rows):
    begin_seals(rows, 2, "aa")
    add(rows, 3, "record", "outcome", "images")
    assert check_seals(rows) == ([], ["inspections 1 to 2 are missing, of before the seals"])


def test_without_seals_nothing_is_compared(rows):
    assert check_seals(rows) == ([], [])


def test_each_part_has_to_be_sealed(rows):
    begin_seals(rows, 0, "aa")
    add(rows, 1)
    assert check_seals(rows) == (
        [
            f"inspection 1: {part} not sealed: it was not the station that added it"
            for part in ("record", "outcome", "images")
        ],
        [],
    )


def test_what_the_last_seal_does_not_cover_is_a_fault(rows):
    begin_seals(rows, 0, "aa")
    add(rows, 1, "record", "outcome", "images")
    rows.execute(update(inspections).values(outcome="FAIL"))
    changed = ["inspection 1: outcome changed: row 2 of the audit trail seals another"]
    assert check_seals(rows) == (changed, [])
    seal(rows, 1, "outcome")
    assert check_seals(rows) == ([], [])
    rows.execute(delete(inspections))
    faults, _ = check_seals(rows)
    assert faults == [f"inspection 1: it is missing; row {row} of the audit trail seals it" for row in (2, 3)]
