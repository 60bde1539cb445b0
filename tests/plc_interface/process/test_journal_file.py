"""The journal on the disk."""

import pytest

from plc_interface.handshake.journal import Journal
from plc_interface.process.journal_file import JournalFile
from station.errors import StationError
from station.messages import line as messages


def test_what_was_written_is_read(tmp_path):
    file = JournalFile(tmp_path / "plc")
    assert file.read() == Journal()
    kept = Journal(boots=3, highest=9, hidden=(8,), command_sequence=1)
    file.write(kept, durable=True)
    assert file.read() == kept
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


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "plc").write_text("")
    with pytest.raises(StationError, match="cannot keep its journal in"):
        JournalFile(tmp_path / "plc")
