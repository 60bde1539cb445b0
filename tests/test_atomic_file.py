"""A file that is replaced is whole after every kill, and durable in the right order."""

import os
import signal
import subprocess
import sys

import pytest

from station.atomic_file import PARTIAL, write_atomically

FOR_EVER = """
import itertools, sys
from pathlib import Path
from station.atomic_file import write_atomically
for letter in itertools.cycle((b"a", b"b")):
    write_atomically(Path(sys.argv[1]), letter * 300_000)
    print(flush=True)
"""


def test_a_killed_writer_leaves_the_old_or_the_new_file(tmp_path):
    path = tmp_path / "state.json"
    whole = {letter * 300_000 for letter in (b"a", b"b")}
    for writes in range(1, 13):
        with subprocess.Popen([sys.executable, "-c", FOR_EVER, str(path)], stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            for _ in range(writes):
                assert writer.stdout.readline()
            writer.send_signal(signal.SIGKILL)
        assert path.read_bytes() in whole
    assert all(left.name.endswith(PARTIAL) for left in tmp_path.iterdir() if left != path)


def test_content_is_on_the_disk_before_the_name_and_the_name_before_it_returns(tmp_path, monkeypatch):
    path, steps = tmp_path / "state.json", []
    fsync, replace = os.fsync, os.replace

    def noted_fsync(descriptor):
        steps.append("folder" if os.path.isdir(f"/proc/self/fd/{descriptor}") else "file")  # noqa: PTH112
        fsync(descriptor)

    def noted_replace(source, target):
        steps.append("replace")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(os, "replace", noted_replace)
    write_atomically(path, b"new", 0o600)
    assert steps == ["file", "replace", "folder"]
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"new", 0o600)
    write_atomically(path, b"newer", durable=False)
    assert (steps[3:], path.read_bytes()) == (["replace"], b"newer")


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "state.json"
    path.write_bytes(b"old")

    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, b"new")
    assert (path.read_bytes(), list(tmp_path.iterdir())) == (b"old", [path])


def test_the_name_of_the_unfinished_file_is_not_interned(tmp_path, interned):
    (path := tmp_path / "state.json").write_bytes(b"old")
    interned.clear()
    write_atomically(path, b"new")
    assert interned == []


def test_a_name_without_a_folder_is_in_the_current_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_atomically("state.json", b"new")
    assert [file.name for file in tmp_path.iterdir()] == ["state.json"]


def test_a_new_file_has_the_permissions_that_the_umask_leaves(tmp_path):
    path = tmp_path / "state.json"
    before = os.umask(0o027)
    try:
        write_atomically(path, b"new")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640
