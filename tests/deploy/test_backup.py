"""Copies of records, state and configuration, as the timer has them made."""

import grp
import itertools
import json
import os
import pwd
import runpy
import shutil
import sqlite3
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from station.outbox.secrets import password
from station.records.last_backup import last_backup_utc_s


def make_installation(installer, folder):
    """A scratch root with this environment as its release."""
    layout = installer("layout").Layout(folder)
    release = layout.releases / "0.1.0+test"
    (release / "venv/bin").mkdir(parents=True)
    (release / "venv/bin/station").write_text(f'#!/bin/sh\nexec {sys.executable} -m station "$@"\n')
    (release / "venv/bin/station").chmod(0o755)
    installer("layout").write_note(release / "release.json", {"version": "0.1.0"})
    installer("layout").point(layout.current, release)
    for made in (layout.settings, layout.home, layout.backups):
        made.mkdir(parents=True)
    layout.configuration.write_text("hmi: {port: 8443}\n")
    (layout.home / "golden_reference.png").write_text("untouched gel")
    (layout.home / "run").mkdir()
    return layout


@pytest.fixture
def installed(installer, tmp_path):
    """An installation in a scratch root."""
    return make_installation(installer, tmp_path)


def station(layout, *arguments):
    command = [layout.current / "venv/bin/station", *arguments]
    done = subprocess.run(command, env=layout.environment(), check=True, capture_output=True, text=True)
    return done.stdout


def begin_records(layout, after):
    """Records as a station's first start makes them, whose next number is `after` + 1."""
    station(layout, "records", "continue-after", str(after))
    begin = "import asyncio,sys\nfrom pathlib import Path\nfrom station.records.records import Records\n"
    begin += "from station.settings.records import RecordsSettings\nasync def go():\n"
    begin += " records = Records(Path(sys.argv[1]), RecordsSettings(), 'boot')\n await records.reopen()\n"
    begin += " await records.close()\nasyncio.run(go())\n"
    subprocess.run([sys.executable, "-c", begin, layout.home / "records"], check=True, capture_output=True)


def backup(root, layout, *arguments):
    command = [sys.executable, root / "deploy/backup", "--root", layout.root, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_all_that_cannot_be_made_again_is_copied_and_the_oldest_goes(root, installed, installer):
    begin_records(installed, 41)
    for _ in range(3):
        done = backup(root, installed, "--keep", "2")
        assert done.returncode == 0, done.stdout
    copies = sorted(installed.backups.iterdir())
    assert len(copies) == 2
    newest = copies[-1]
    assert (newest / "settings/station.yaml").read_text() == "hmi: {port: 8443}\n"
    assert (newest / "state/golden_reference.png").exists()
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


def test_of_two_backups_at_once_the_second_waits_and_both_are_complete(installer, installed, monkeypatch):
    (installed.home / "records").mkdir()
    (installed.home / "records/records.sqlite3").touch()
    module, release, others = installer("backup"), installed.current.resolve(), []

    def copy_records(_layout, _release, *words, **_options):
        if not others:  # the daily one begins while the upgrade's copies; without waiting it would end at once
            others.append(pool.submit(module.make_backup, installed, release, "daily-"))
            wait(others, timeout=1.0)
        words[-1].mkdir()
        (words[-1] / "records.sqlite3").touch()

    monkeypatch.setattr(module, "station", copy_records)
    with ThreadPoolExecutor(1) as pool:
        first = module.make_backup(installed, release, "before-upgrade-")
        copies = [first, others[0].result(60)]
    assert sorted(installed.backups.iterdir()) == sorted(copies)
    assert all((copy / "records/records.sqlite3").exists() for copy in copies)


def test_a_backup_whose_records_are_gone_is_none(installer, installed, monkeypatch):
    (installed.home / "records").mkdir()
    (installed.home / "records/records.sqlite3").touch()
    monkeypatch.setattr(installer("backup"), "station", lambda *_words, **_options: None)
    with pytest.raises(installer("messages").Failed, match="has no records, so there is no backup"):
        installer("backup").make_backup(installed, installed.current.resolve(), "daily-")
    assert not [path for path in installed.backups.iterdir() if not path.name.startswith(".")]


def test_a_link_that_the_stations_user_put_there_is_not_followed(root, installed, installer, monkeypatch, tmp_path):
    shadow, missing = tmp_path / "shadow", tmp_path / "missing"
    shadow.touch()
    os.utime(shadow, (1.0, 1.0))
    (installed.home / "last_backup").symlink_to(shadow)
    assert backup(root, installed).returncode == 0
    assert shadow.stat().st_mtime == 1.0
    assert not (installed.home / "last_backup").is_symlink()

    # One's own name is given to a link that leads nowhere, which needs no root; a program that followed it would fail.
    (link := tmp_path / "link").symlink_to(missing)
    programs = installer("programs")
    user, group = pwd.getpwuid(os.getuid())[0], grp.getgrgid(os.getgid())[0]
    monkeypatch.setattr(programs, "known_user", lambda: True)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    programs.own(installer("layout").Layout(Path("/")), link, user, group)


def test_an_old_backup_that_only_root_may_remove_stops_no_new_one(root, installed, installer, monkeypatch, capsys):
    (installed.home / "lost+found").mkdir()
    for day in (1, 2, 3):
        made_before(installed, f"daily-2026010{day}T000000Z", day)
    remove = shutil.rmtree

    def rmtree(path, **options):
        if path.name == "daily-20260101T000000Z":
            raise PermissionError(13, "Permission denied", str(path))
        remove(path, **options)

    monkeypatch.setattr(shutil, "rmtree", rmtree)
    monkeypatch.setattr(sys, "argv", ["backup", "--root", str(installed.root), "--keep", "2"])
    assert runpy.run_path(str(root / "deploy/backup"))["main"]() == 0
    assert "daily-20260101T000000Z cannot be removed (Permission denied): remove it as root" in capsys.readouterr().out
    old, last, made = sorted(installed.backups.iterdir())
    assert (old.name, last.name) == ("daily-20260101T000000Z", "daily-20260103T000000Z")
    assert (made / "settings/station.yaml").exists()
    assert not (made / "state/lost+found").exists(), "which only root may read where the home is a disk of its own"


def test_root_backs_up_as_the_stations_user(root, installer, installed, monkeypatch, capsys):
    """In the user's folders root would follow links to any file; the upgrade calls the same program."""
    done, programs = [], installer("programs")
    user = SimpleNamespace(pw_uid=990, pw_gid=991)
    system = installer("layout").Layout(Path("/"))
    with monkeypatch.context() as patch:
        patch.setattr(os, "geteuid", lambda: 0)
        patch.setattr(programs, "known_user", lambda: True)
        patch.setattr(programs.pwd, "getpwnam", lambda name: user if name == "fruit-station" else None)
        for name in ("initgroups", "setgid", "setuid"):
            patch.setattr(os, name, lambda *words, name=name: done.append((name, *words)))
        programs.become_user(system)
        assert done == [("initgroups", "fruit-station", 991), ("setgid", 991), ("setuid", 990)]
        done.clear()
        programs.become_user(installed)
        assert not done, "in a scratch root there is no such user"

    def make_backup(_layout, _release, kind):
        done.append(kind)
        return installed.backups

    monkeypatch.setattr(programs, "become_user", lambda layout: done.append(layout.root))
    monkeypatch.setattr(installer("backup"), "make_backup", make_backup)
    monkeypatch.setattr(sys, "argv", ["backup", "--root", str(installed.root), "--kind", "before-upgrade-"])
    assert runpy.run_path(str(root / "deploy/backup"))["main"]() == 0
    assert done == [installed.root, "before-upgrade-"]
    assert f"copied to {installed.backups}" in capsys.readouterr().out


def test_a_backup_has_its_name_only_when_it_is_on_the_disk(installer, installed, monkeypatch):
    seen = []

    def sync():
        (partial,) = installed.backups.iterdir()
        seen.append((partial.name[0], (partial / "settings/station.yaml").is_file()))

    monkeypatch.setattr(os, "sync", sync)
    made = installer("backup").make_backup(installed, installed.current.resolve(), "daily-")
    assert seen == [(".", True)]
    assert made.name.startswith("daily-")


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


STAND_INS = {
    "sudo": 'exec "$@"',
    "runuser": 'shift 3; exec "$@"',
    "station": 'exec "$PROGRAM" "$@"',
    **dict.fromkeys(("systemctl", "chown", "chgrp", "systemd-tmpfiles"), 'echo "$(basename "$0")" "$@" >> "$LOG"'),
}
"""For a scratch root, where nothing runs and there is no other user."""


def documented_restore(root):
    """The commands of docs/deployment.md that restore a backup."""
    text = (root / "docs/deployment.md").read_text()
    return text.split("To restore a backup", 1)[1].split("```\n", 2)[1]


def test_a_replacement_machine_is_restored_as_the_document_has_it(root, installer, tmp_path):
    lost, new = (make_installation(installer, tmp_path / name) for name in ("lost", "new"))
    begin_records(lost, 41)
    (lost.home / "calibrations").mkdir()
    (lost.home / "calibrations/newest.json").write_text("{}")
    (lost.home / "plc").mkdir()
    for name, then, now in (
        ("held_for_a_person", "no", "fruit_held"),
        ("mode", "1", "3"),
        ("plc/journal.json", "1", ""),
        ("active_recipe.json", "then", ""),
        ("named_lot", "A-17", ""),
    ):
        (lost.home / name).write_text(then)
        if now:
            (new.home / name).write_text(now)
    lost.configuration.write_text("hmi: {port: 9443}\n")
    (lost.settings / "postgresql-password").write_text("secret\n")
    (lost.settings / "postgresql-password").chmod(0o600)
    public_key = station(lost, "audit", "public-key")
    assert backup(root, lost).returncode == 0
    (made,) = lost.backups.iterdir()
    begin_records(new, 0)
    shutil.copytree(made, new.backups / made.name)
    (new.backups / "station-7.pem").write_text(public_key)

    stand_ins = tmp_path / "bin"
    stand_ins.mkdir()
    for name, does in STAND_INS.items():
        (stand_ins / name).write_text(f"#!/bin/sh\n{does}\n")
        (stand_ins / name).chmod(0o755)
    commands = documented_restore(root).replace("daily-20260630T033412Z", made.name)
    for folder in ("/var/", "/etc/"):
        commands = commands.replace(folder, f"{new.root}{folder}")
    before = new.settings.stat()
    done = subprocess.run(
        ["sh", "-eu", "-c", commands], capture_output=True, text=True, check=False, cwd=tmp_path,
        env=new.environment() | {
            "PATH": f"{stand_ins}:{os.environ['PATH']}", "LOG": str(tmp_path / "log"),
            "PROGRAM": str(new.current / "venv/bin/station"), "PYTHONPATH": str(root),
        },
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "restored 0 inspections" in done.stdout
    assert new.configuration.read_text() == "hmi: {port: 9443}\n"
    assert (new.home / "calibrations/newest.json").exists()
    assert (new.home / "held_for_a_person").read_text() == "fruit_held", "what is so in the cell now"
    assert (new.home / "mode").read_text() == "3"
    assert not (new.home / "plc").exists()
    assert not (new.home / "active_recipe.json").exists(), "a person chooses the recipe of the fruit that runs now"
    assert not (new.home / "named_lot").exists(), "and starts the lot that runs now"
    after = new.settings.stat()
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)
    log = (tmp_path / "log").read_text()
    assert f"chgrp -R fruit-station {new.settings}" in log
    assert password(new.settings / "postgresql-password", "PGPASSWORD") == "secret"
    assert f"chown fruit-station {new.settings}/postgresql-password\n" in log, "the station's, as before"
    assert "systemd-tmpfiles --create fruit-station.conf" in log
    assert log.splitlines()[-1] == "systemctl start fruit-station"


def made_before(layout, name, sequence):
    """A backup whose name has the time when it was made, and whose records have this highest number."""
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


def test_after_records_began_anew_the_backups_of_those_before_go_first(root, installed):
    begin_records(installed, 50)
    for day, sequence in ((1, 99_999), (2, 100_000), (3, 48), (4, 49)):
        made_before(installed, f"daily-2026010{day}T000000Z", sequence)
    done = backup(root, installed, "--keep", "3")
    assert done.returncode == 0, done.stdout
    left = {path.name for path in installed.backups.iterdir()}
    assert len(left) == 3
    assert left > {"daily-20260103T000000Z", "daily-20260104T000000Z"}


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


def test_a_rollback_without_room_to_restore_the_records_is_refused_before_the_station_stops(
    installed, installer, monkeypatch
):
    old, rollback = installed.current.resolve(), installer("rollback")
    installer("layout").point(installed.previous, old)
    copy = installed.backups / "before-upgrade-20260101T000000Z"
    for folder, schema in ((installed.home, 8), (copy, 7)):
        (folder / "records").mkdir(parents=True)
        with closing(sqlite3.connect(folder / "records/records.sqlite3")) as connection:
            connection.executescript(
                f"CREATE TABLE alembic_version (version_num); INSERT INTO alembic_version VALUES ({schema})"
            )
    (copy / "records/backup.json").write_text(json.dumps({"sequence": 1, "size_bytes": 30_000_000}))
    note = {"from": old.name, "to": "0.2.0+test", "copy": copy.name, "schema": "7", "configuration": None}
    installer("layout").write_note(installed.upgrade, note)
    monkeypatch.setattr(rollback, "station", lambda *_words: '{"records": {"free_reserve_mb": 200}}')
    free = [229_000_000]
    monkeypatch.setattr(rollback.shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(10**12, 0, free[0]))
    with pytest.raises(installer("messages").Refused, match="has 229 MB of free space, 230 MB are needed to restore"):
        rollback.roll_back(installed, None)
    free[0] = 230_000_000
    rollback.check(installed)


def test_records_that_nobody_can_read_are_restored_by_a_rollback(installed, installer):
    rollback = installer("rollback")
    installer("layout").point(installed.previous, installed.current.resolve())
    copy = installed.backups / "before-upgrade-20260101T000000Z"
    for folder in (installed.home, copy):
        (folder / "records").mkdir(parents=True)
        (folder / "records/records.sqlite3").touch()
    with closing(sqlite3.connect(copy / "records/records.sqlite3")) as connection:
        connection.executescript("CREATE TABLE alembic_version (version_num); INSERT INTO alembic_version VALUES (7)")
    note = {"from": "0.1.0+test", "to": "0.2.0+test", "copy": copy.name, "schema": "7", "configuration": None}
    installer("layout").write_note(installed.upgrade, note)
    rollback.check(installed)
    assert rollback._restores(installed, copy)


@pytest.fixture
def words():
    """The words that an upgrade replaces in the configuration."""
    return {"old": "new"}


@pytest.fixture
def upgraded(installed, installer, words, monkeypatch):
    """An installation whose upgrade changes words in the configuration, and whose programs are stand-ins."""
    layouts, numbers = installer("layout"), itertools.count(1)
    installed.configuration.write_text("# old\n")

    def changes(layout, _release):
        text = layout.configuration.read_text().split()
        return tuple(f"{old} is {new} now" for old, new in words.items() if old in text)

    def migrate(layout, _release):
        text = layout.configuration.read_text().split()
        layout.configuration.write_text(" ".join(words.get(word, word) for word in text) + "\n")

    def make_backup(layout, _release, kind, _keep):
        (copy := layout.backups / f"{kind}{next(numbers)}").mkdir()
        return copy

    def make(layout, source, _packages):
        (layout.releases / source.name).mkdir()
        layouts.write_note(layout.releases / source.name / "release.json", {"version": source.version})

    monkeypatch.setattr(installer("configuration"), "try_with", changes)
    monkeypatch.setattr(installer("configuration"), "migrate", migrate)
    monkeypatch.setattr(installer("backup"), "make_backup_as_user", make_backup)
    monkeypatch.setattr(installer("installation"), "make", make)
    for name in ("put", "make_folder", "make_folders", "make_place"):
        monkeypatch.setattr(installer("site_files"), name, lambda *_: None)
    return installed


@pytest.fixture
def services():
    """Services of which nothing runs."""
    started = dict.fromkeys(("running", "start"), lambda: False)
    return SimpleNamespace(**dict.fromkeys(("stop", "reload", "enable", "make_user"), lambda: None), **started)


@pytest.mark.parametrize("second_changes", [{}, {"new": "newer"}])
def test_an_upgrade_after_one_to_another_release_was_interrupted_is_taken_back_to_the_configuration_of_before(
    upgraded, installer, services, words, second_changes
):
    failed, old = installer("messages").Failed, upgraded.current.resolve()

    def upgrade(version):
        source = SimpleNamespace(name=f"{version}+test", version=version, folder=upgraded.root)
        return installer("installation").Installation(upgraded, services, source, None)

    for step in upgrade("0.2.0").steps()[:5]:  # up to the configuration's migration; then the power failed
        step.do()
    assert upgraded.configuration.read_text() == "# new\n"
    words.update(second_changes)
    starts = iter([failed("it does not start")])

    def start():
        for error in starts:
            raise error
        return False

    services.start = start
    with pytest.raises(failed, match=r"0\.2\.1\+test is not in use: 0\.1\.0\+test is again"):
        upgrade("0.2.1").run()
    assert upgraded.configuration.read_text() == "# old\n"
    assert upgraded.current.resolve() == old


def test_a_rollback_that_is_repeated_keeps_the_configuration_that_it_replaced(
    upgraded, installer, services, monkeypatch
):
    rollback, failed = installer("rollback"), installer("messages").Failed
    installer("layout").point(upgraded.previous, upgraded.current.resolve())
    note = {"from": "0.1.0+test", "copy": "before-upgrade-1", "schema": "", "configuration": "# old\n"}
    installer("layout").write_note(upgraded.upgrade, note)
    upgraded.configuration.write_text("# new, and a person's\n")
    answers = iter([failed("the station is not healthy"), None])

    def wait(*_words, **_options):
        if (error := next(answers)) is not None:
            raise error

    monkeypatch.setattr(rollback, "wait_until_healthy", wait)
    services.start = lambda: True
    with pytest.raises(failed, match="not healthy"):
        rollback.roll_back(upgraded, services)
    rollback.roll_back(upgraded, services)
    assert upgraded.configuration.read_text() == "# old\n"
    assert upgraded.configuration.with_name("station.yaml.rolled-back").read_text() == "# new, and a person's\n"
