"""Copies of records, state and configuration, as the timer has them made."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest

from station.records.last_backup import last_backup_utc_s


@pytest.fixture
def installed(installer, tmp_path):
    """A scratch root with this environment as its release."""
    layout = installer("layout").Layout(tmp_path)
    release = layout.releases / "0.1.0+test"
    (release / "venv/bin").mkdir(parents=True)
    (release / "venv/bin/station").write_text(f'#!/bin/sh\nexec {sys.executable} -m station "$@"\n')
    (release / "venv/bin/station").chmod(0o755)
    installer("layout").write_note(release / "release.json", {"version": "0.1.0"})
    installer("layout").point(layout.current, release)
    for folder in (layout.settings, layout.home, layout.backups):
        folder.mkdir(parents=True)
    layout.configuration.write_text("hmi: {port: 8443}\n")
    (layout.home / "active_recipe.json").write_text("{}")
    (layout.home / "run").mkdir()
    return layout


def backup(root, layout, *arguments):
    command = [sys.executable, root / "deploy/backup", "--root", layout.root, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_all_that_cannot_be_made_again_is_copied_and_the_oldest_goes(root, installed, installer):
    subprocess.run(
        [installed.current / "venv/bin/station", "records", "continue-after", "41"],
        env=installed.environment(), check=True, capture_output=True,
    )  # fmt: skip
    begin = "import asyncio,sys\nfrom pathlib import Path\nfrom station.records.records import Records\n"
    begin += "from station.settings.records import RecordsSettings\nasync def go():\n"
    begin += " records = Records(Path(sys.argv[1]), RecordsSettings(), 'boot')\n await records.reopen()\n"
    begin += " await records.close()\nasyncio.run(go())\n"
    subprocess.run([sys.executable, "-c", begin, installed.home / "records"], check=True, capture_output=True)
    for _ in range(3):
        done = backup(root, installed, "--keep", "2")
        assert done.returncode == 0, done.stdout
    copies = sorted(installed.backups.iterdir())
    assert len(copies) == 2
    newest = copies[-1]
    assert (newest / "settings/station.yaml").read_text() == "hmi: {port: 8443}\n"
    assert (newest / "state/active_recipe.json").exists()
    assert not (newest / "state/run").exists()
    assert json.loads((newest / "records/backup.json").read_text())["sequence"] == 41
    assert (
        installer("backup").schema_version(newest / "records")
        == installer("backup").schema_version(installed.home / "records")
        != ""
    )


def test_a_copy_that_failed_leaves_nothing_that_looks_like_one(root, installed):
    (installed.home / "records").mkdir()
    (installed.home / "records/records.sqlite3").write_text("this is no database")
    done = backup(root, installed)
    assert done.returncode == 1
    assert "records" in done.stdout
    assert "Traceback" not in done.stderr
    assert not [path for path in installed.backups.iterdir() if not path.name.startswith(".")]


def test_without_a_station_there_is_nothing_to_copy(root, tmp_path, installer):
    assert backup(root, installer("layout").Layout(tmp_path)).returncode == 2


def test_a_complete_copy_is_what_the_metrics_tell_the_time_of(root, installed):
    assert last_backup_utc_s(installed.home) == 0
    assert backup(root, installed).returncode == 0
    assert last_backup_utc_s(installed.home) > 1_700_000_000
    os.utime(installed.home / "last_backup", (1.0, 1.0))
    (installed.home / "records").mkdir()
    (installed.home / "records/records.sqlite3").write_text("this is no database")
    assert backup(root, installed).returncode == 1
    assert last_backup_utc_s(installed.home) == 1.0


def test_a_file_that_cannot_be_read_is_named(installer, installed, monkeypatch):
    key = installed.settings / "authority.key"
    key.write_text("secret")

    def only_root_may_read_it(source, to):
        if source == str(key):
            raise PermissionError(13, "Permission denied", source)

    monkeypatch.setattr(shutil, "copy2", only_root_may_read_it)
    with pytest.raises(installer("messages").Failed, match=rf"{key} cannot be read, so there is no backup"):
        installer("backup").make_backup(installed, installed.current.resolve(), "daily-")
    assert last_backup_utc_s(installed.home) == 0


def made_before(layout, name, sequence):
    """A backup whose name says when it was made, and whose records have this highest number."""
    (layout.backups / name / "records").mkdir(parents=True)
    (layout.backups / name / "records/backup.json").write_text(json.dumps({"sequence": sequence}))


def test_after_a_clock_was_set_back_the_copy_just_made_stays_and_the_oldest_records_go(root, installed):
    for name, sequence in (("daily-20990103T000000Z", 1), ("daily-20990101T000000Z", 2), ("daily-20990102T000000Z", 3)):
        made_before(installed, name, sequence)
    done = backup(root, installed, "--keep", "3")
    assert done.returncode == 0, done.stdout
    left = {path.name for path in installed.backups.iterdir()}
    assert "daily-20990103T000000Z" not in left
    (made,) = left - {"daily-20990101T000000Z", "daily-20990102T000000Z"}
    assert (installed.backups / made / "settings/station.yaml").exists()


def test_a_rollback_without_its_copy_is_refused_where_the_records_need_it(installed, installer):
    old = installed.current.resolve()
    installer("layout").point(installed.previous, old)
    note = {"from": old.name, "to": "0.2.0+test", "copy": "before-upgrade-20260101T000000Z", "configuration": None}
    (installed.home / "records").mkdir()
    with closing(sqlite3.connect(installed.home / "records/records.sqlite3")) as connection:
        connection.executescript("CREATE TABLE alembic_version (version_num); INSERT INTO alembic_version VALUES (8)")
    check, refused = installer("rollback").check, installer("messages").Refused
    installer("layout").write_note(installed.upgrade, {**note, "schema": "7"})
    with pytest.raises(refused, match="before-upgrade-20260101T000000Z is gone"):
        check(installed)
    installer("layout").write_note(installed.upgrade, {**note, "schema": "8"})
    check(installed)
    installer("layout").write_note(installed.upgrade, {**note, "schema": "7"})
    made_before(installed, note["copy"], 1)
    check(installed)
