"""The audit trail: it only grows, and every change behind its back is found."""

import asyncio
import errno
import json
import sqlite3

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from station.messages import records as messages
from station.records.audit import AuditEntry, AuditRow, append_audit
from station.records.audit_head import Head, read_head, save_head
from station.records.database import reading
from station.records.direct_transaction import direct_transaction
from station.records.errors import BadRecordError
from station.records.records import Records
from station.settings.records import RecordsSettings
from tests.records.causes import because


def test_a_whole_trail_is_whole_and_can_be_read(trail, station):
    trail(5, reason="because", old={"limit": 112.0}, new={"limit": 118.5})
    code, output = station("audit", "verify")
    assert code == 0
    assert output.startswith("OK 5 rows, the last one is 5:")
    code, output = station("audit", "show", "--last", "2", "--action", "test")
    assert code == 0
    assert "thing 3" in output
    assert "thing 2" not in output
    assert "by Ida (quality)" in output
    assert "because" in output
    assert "old: limit 112.0" in output


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE audit SET reason = 'another' WHERE seq = 3",
        "DELETE FROM audit WHERE seq = 3",
        "INSERT OR REPLACE INTO audit SELECT 3, 0, who, role, action, '', '', old, new, hash, hash FROM audit LIMIT 1",
        "DELETE FROM audit",
    ],
)
def test_the_database_itself_refuses_to_change_a_row(trail, folder, station, statement):
    trail(5)
    connection = sqlite3.connect(folder / "records.sqlite3")
    with pytest.raises(sqlite3.IntegrityError, match="the audit trail only grows"):
        connection.execute(statement)
    connection.close()
    assert station("audit", "verify")[0] == 0


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE audit SET who = 'Eve' WHERE seq = 3", "BROKEN row 3: it was changed"),
        ("UPDATE audit SET new = '1' WHERE seq = 2", "BROKEN row 2: it was changed"),
        ("DELETE FROM audit WHERE seq = 3", "BROKEN row 4: rows 3 to 3 before it are missing"),
        ("DELETE FROM audit WHERE seq < 3", "BROKEN row 3: it is the first here, and rows 1 to 2 are missing"),
        ("DELETE FROM audit WHERE seq > 3", "BROKEN row 5: it is missing, and the head kept beside"),
        ("DELETE FROM audit", "BROKEN row 5: it is missing, and the head kept beside"),
    ],
)
def test_the_first_broken_row_is_named(trail, station, meddle, statement, message):
    trail(5)
    meddle(statement)
    code, output = station("audit", "verify")
    assert code == 1
    assert output.startswith(message)


def test_a_row_forged_with_its_hash_is_found_by_the_next(trail, folder, station, meddle):
    trail(3)
    with reading(folder) as connection:
        row = AuditRow(*connection.exec_driver_sql("SELECT * FROM audit WHERE seq = 2").one())
    forged = AuditRow(*row_values(row, who="Eve"))
    meddle(f"UPDATE audit SET who = 'Eve', hash = '{forged.true_hash}' WHERE seq = 2")
    code, output = station("audit", "verify")
    assert code == 1
    assert output.startswith("BROKEN row 3: it was not written behind row 2 as that is now")


def row_values(row, **changed):
    return [changed.get(name, getattr(row, name)) for name in row.__slots__]


def test_rows_cut_off_are_told_by_the_next_start_too_and_by_an_anchor(trail, folder, station, meddle):
    trail(5)
    anchor = station("audit", "verify")[1].split()[-1]
    meddle("DELETE FROM audit WHERE seq > 3")
    (folder / "audit_head").unlink()
    code, output = station("audit", "verify", "--anchor", anchor)
    assert code == 1
    assert "row 5: it is missing, and the anchor names it" in output
    assert "the head kept beside the database is missing" in output
    trail(1)
    with reading(folder) as connection:
        last = connection.exec_driver_sql("SELECT seq, action FROM audit WHERE seq > 3 ORDER BY seq").all()
    assert last[0].action == "audit.continued"
    assert last[0].seq > 5, "no number is given twice"
    code, output = station("audit", "verify")
    assert code == 1
    assert f"row {last[0].seq}: rows before it are missing: a start found up to row 3 here" in output
    assert station("audit", "verify", "--since", str(last[1].seq))[0] == 0


def test_after_a_restoring_the_trail_is_whole_and_tells_what_is_missing(trail, folder, station, meddle, tmp_path):
    copy = tmp_path / "copy"
    trail(3)
    code, output = station("records", "backup", str(copy))
    assert code == 0
    anchor = output.split()[-1]
    assert json.loads((copy / "backup.json").read_text())["audit_head"] == anchor
    trail(2)
    lost = station("audit", "verify")[1].split()[-1]
    assert station("records", "restore", str(copy), "--by", "Ida")[0] == 0
    code, output = station("audit", "verify", "--anchor", anchor)
    assert code == 0
    assert "Ida put back a backup that ends with row 3; rows up to 5 are in the records that were moved aside" in output
    assert "OK 4 rows" in output
    trail(1)
    assert station("audit", "verify")[0] == 0
    assert "row 5: it is missing" in station("audit", "verify", "--anchor", lost)[1]
    meddle("UPDATE audit SET old = NULL WHERE action = 'records.restored'")
    assert station("audit", "verify")[0] == 1


@pytest.fixture
def copy(trail, station, tmp_path):
    """A backup of three rows of a trail of five."""
    trail(3)
    assert station("records", "backup", str(tmp_path / "copy"))[0] == 0
    trail(2)
    return tmp_path / "copy"


@pytest.fixture
def start(opened, scenario):
    """Start a station, and end it."""

    async def steps():
        async with opened():
            pass

    return lambda: scenario(steps)


def test_a_restore_that_fails_leaves_the_head_of_the_present_trail(copy, start, folder, station, monkeypatch):
    head = (folder / "audit_head").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr("station.records.restore.move_aside", _full)
        assert station("records", "restore", str(copy), "--by", "Ida")[0] == 1
    assert (folder / "audit_head").read_bytes() == head
    start()
    assert station("audit", "verify")[0] == 0


def test_a_restore_whose_head_could_not_be_saved_is_a_note_and_no_break(copy, start, station, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("station.records.audit_head.save_head", _full)
        assert station("records", "restore", str(copy), "--by", "Ida")[0] == 0
    start()
    code, output = station("audit", "verify")
    assert code == 0, output
    assert "Ida put back a backup that ends with row 3; rows up to 5 are in the records that were moved aside" in output
    assert "without a signed head" in output


def _full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_backup_put_back_on_another_machine_has_a_whole_trail(trail, folder, station, tmp_path):
    trail(3)
    station("records", "backup", str(tmp_path / "copy"))
    folder.rename(tmp_path / "the other machine's")
    code, output = station("records", "restore", str(tmp_path / "copy"), "--by", "Ida")
    assert (code, "give the public key of the station that made it" in output) == (1, True)
    key = str(tmp_path / "the other machine's" / "public_key.pem")
    assert station("records", "restore", str(tmp_path / "copy"), "--by", "Ida", "--public-key", key)[0] == 0
    code, output = station("audit", "verify")
    assert (code, "note" in output) == (0, False)
    assert output.startswith("OK 4 rows, the last one is 4:")


def test_a_backup_of_a_trail_that_was_cut_says_so(trail, station, meddle, tmp_path):
    trail(5)
    meddle("DELETE FROM audit WHERE seq > 3")
    code, output = station("records", "backup", str(tmp_path / "copy"))
    assert code == 0
    assert "note: the audit trail lacks rows that it had" in output


def test_the_trail_goes_on_where_the_database_was_lost(trail, folder, station):
    trail(4)
    for file in folder.glob("records.sqlite3*"):
        file.unlink()
    trail(1)
    code, output = station("audit", "verify")
    assert code == 1
    assert "a start found no rows here, and row 4 was known to be the last" in output


def test_the_station_writes_to_the_same_trail_as_a_command_beside_it(trail, folder, station):
    async def steps():
        records = await Records.open(folder, RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")
        try:
            (first,) = await records.audit(AuditEntry("Ida", "quality", "test.done", "a"))
            await asyncio.to_thread(trail, 1)
            second, third = await records.audit(
                AuditEntry("plc", "plc", "test.done", "b"), AuditEntry("plc", "plc", "test.done", "c")
            )
            assert (first.seq, second.seq, third.seq) == (2, 4, 5), "the first start's own row is before"
            with pytest.raises(BadRecordError, check=because(messages.AUDIT_WORD)):
                await records.audit(AuditEntry(" ", "plc", "test.done", "d"))
        finally:
            await records.close()

    asyncio.run(steps())
    head = read_head(folder)
    assert head is not None
    assert head.seq == 5
    assert station("audit", "verify")[1].startswith("OK 5 rows")


def test_what_is_undone_leaves_no_row(folder, trail, station):
    trail(1)

    def fail():
        with direct_transaction(folder) as connection:
            append_audit(connection, AuditEntry("Ida", "quality", "test.done", "x"))
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fail()
    assert station("audit", "verify")[1].startswith("OK 1 rows")


@pytest.mark.parametrize("anchor", ["5", "x:y", "5:abc", "\u0665:" + "0" * 64])
def test_an_anchor_that_is_none_is_bad_input(trail, station, anchor):
    trail(1)
    assert station("audit", "verify", "--anchor", anchor)[0] == 2


@pytest.mark.parametrize("values", [{"who": "a\nb"}, {"role": ""}, {"action": "x" * 65}, {"reason": "\x1b[2J"}])
def test_a_malformed_entry_is_refused(trail, station, values):
    with pytest.raises(BadRecordError, check=because(messages.AUDIT_WORD, messages.AUDIT_TEXT)):
        trail(1, **values)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30, deadline=None)
@given(st.lists(st.integers(1, 2**31), min_size=1, max_size=8), st.integers(0, 200), st.integers(0, 255))
def test_a_torn_line_of_the_head_leaves_the_one_before(tmp_path, numbers, place, byte):
    """For any single spoilt byte of the file, the head is one of the last two, or the last."""
    (tmp_path / "audit_head").unlink(missing_ok=True)
    heads = [Head(number, f"{number:064x}") for number in sorted(set(numbers))]
    for head in heads:
        save_head(tmp_path, head)
    head = read_head(tmp_path)
    assert head is not None
    assert head[:2] == heads[-1][:2]
    content = bytearray((tmp_path / "audit_head").read_bytes())
    content[place % len(content)] = byte
    (tmp_path / "audit_head").write_bytes(content)
    head = read_head(tmp_path)
    assert head is not None
    assert head[:2] in [one[:2] for one in heads[-2:]]
