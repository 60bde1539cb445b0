"""A killed process's temporary folder is removed by the next one's start, a living one's is not."""

import subprocess
import sys
import tempfile

import pytest

from station.temporary_folder import make_temporary_folder


def test_only_the_folders_of_dead_processes_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", ""]) as dead:
        pass
    stale = tmp_path / f"fruit-station-run-{dead.pid}-abc"
    others = [tmp_path / "fruit-station-run-1-abc", tmp_path / f"fruit-station-arm-{dead.pid}-abc"]
    for folder in (stale, *others):
        folder.mkdir()
        (folder / "restarts.json").touch()
    with make_temporary_folder("fruit-station-run") as made:
        assert made.startswith(str(tmp_path / "fruit-station-run-"))
        assert not stale.exists()
        assert all(folder.exists() for folder in others)


def test_the_folder_is_of_this_user_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with make_temporary_folder("kind") as made:
        assert (tmp_path / made).stat().st_mode & 0o777 == 0o700
    with pytest.raises(FileNotFoundError):
        (tmp_path / made).stat()
