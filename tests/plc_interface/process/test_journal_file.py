"""The journal on the disk."""

import contextlib
import errno
import json
import os
from pathlib import Path

import pytest

from plc_interface.handshake.journal import Journal
from plc_interface.process.journal_file import JournalFile
from station.errors import StationError
from station.messages import line as messages


def test_what_was_written_is_read(tmp_path):
    file = JournalFile(tmp_path / "plc")
    assert file.read() == Journal()
    journal = Journal(boots=3, highest=9, hidden=(8,), command_sequence=1)
    file.write(journal, durable=True)
    assert file.read() == journal
    written = json.loads((tmp_path / "plc" / "journal.json").read_text(encoding="utf-8"))
    assert written == {"boots": 3, "highest": 9, "hidden": [8], "command_sequence": 1}, "no field that is empty"
    file.close()


@pytest.mark.parametrize("content", [b"", b"{", b'{"boots": "3"}', b"\xff" * 100])
def test_a_damaged_one_is_put_aside_and_the_boots_are_others(tmp_path, content):
    file = JournalFile(tmp_path)
    (tmp_path / "journal.json").write_bytes(content)
    assert file.read().boots > 0
    assert (tmp_path / "journal.damaged").read_bytes() == content
    assert file.read() == Journal()
    file.close()


def test_two_interfaces_do_not_share_one(tmp_path):
    file = JournalFile(tmp_path)
    with pytest.raises(StationError, match="another PLC interface runs"):
        JournalFile(tmp_path)
    file.close()
    JournalFile(tmp_path).close()


def test_a_disk_that_refuses_is_said_and_the_line_goes_on(tmp_path):
    file = JournalFile(tmp_path / "plc")
    (tmp_path / "plc" / "journal.json").mkdir()
    file.write(Journal(), durable=False)
    assert file.trouble is not None
    assert file.trouble.id == messages.JOURNAL_NOT_WRITTEN.id
    (tmp_path / "plc" / "journal.json").rmdir()
    file.write(Journal(), durable=False)
    assert file.trouble is None
    file.close()


def test_a_full_disk_takes_the_journal_all_the_same(small_disk):
    with contextlib.closing(JournalFile(small_disk / "plc")) as file:
        for highest in range(1, 40):
            fill(small_disk / "filler")
            file.write(Journal(highest=highest), durable=True)
            assert file.trouble is None
            assert file.read().highest == highest
        (small_disk / "plc" / "reserve").write_bytes(b"")
        fill(small_disk / "filler")
        file.write(Journal(highest=40), durable=True)
        assert file.trouble is not None, "disk and reserve are full"
        assert file.read().highest == 39
        (small_disk / "filler").unlink()
        file.write(Journal(highest=41), durable=True)
        fill(small_disk / "filler")
        file.write(Journal(highest=42), durable=True)
        assert file.read().highest == 42, "the reserve was taken again"


def test_a_disk_that_fails_otherwise_keeps_the_reserve(tmp_path, monkeypatch):
    file = JournalFile(tmp_path)

    def fails(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr("plc_interface.process.journal_file.write_atomically", fails)
    file.write(Journal(), durable=True)
    assert file.trouble is not None
    assert (tmp_path / "reserve").stat().st_size == 1 << 20
    file.close()


def fill(path: Path) -> None:
    """Take all the space that is left."""
    with contextlib.suppress(OSError), path.open("ab", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "plc").write_text("")
    with pytest.raises(StationError, match="cannot keep its journal in"):
        JournalFile(tmp_path / "plc")
