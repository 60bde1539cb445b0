"""The installer in a scratch root: run twice, interrupted, undone; what it refuses."""

import fcntl
import os
import shutil
import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from pathlib import Path

import pytest
from alembic.script import ScriptDirectory

from station.records.migration import MIGRATIONS

pytestmark = pytest.mark.timeout(900)  # on a busy machine pip takes its time


def test_interrupted_then_installed_twice_then_undone_leaves_nothing(system, root, install, environment, tree_of):
    before = tree_of(system)
    command = [root / "deploy/install", "--root", system, "--environment", environment]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as half:
        deadline_s = time.monotonic() + 60
        while not list(system.glob("opt/fruit-station/releases/*/venv/bin/python")):
            assert half.poll() is None, "it ended before it could be interrupted"
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
        os.killpg(half.pid, signal.SIGKILL)
    assert not list(system.glob("opt/fruit-station/releases/*/release.json"))
    assert not (system / "opt/fruit-station/current").exists()

    first = install("--root", system, "--environment", environment)
    assert first.returncode == 0, first.stdout + first.stderr
    installed = tree_of(system)
    program = system / "opt/fruit-station/current/venv/bin/station"
    checked = subprocess.run([program, "config", "check"], capture_output=True, text=True, check=False)
    assert checked.stdout.startswith("OK"), checked.stderr
    recipes = system / "var/lib/fruit-station/recipes"
    assert {path.name for path in recipes.iterdir()} == {path.name for path in (root / "recipes").glob("*.yaml")}
    assert f'\nrecipes_folder: "{recipes}"\n' in (system / "etc/fruit-station/station.yaml").read_text()
    (recipes / "raspberry.yaml").unlink()  # a site's own decision, which no later run undoes
    installed = tree_of(system)
    assert (system / "etc/systemd/system/fruit-station.service").is_file()
    assert (system / "etc/systemd/system/multi-user.target.wants/fruit-station.service").is_symlink()
    assert (system / "etc/systemd/system/timers.target.wants/fruit-station-backup.timer").is_symlink()
    if os.geteuid() == 0:
        assert "fruit-station:" in (system / "etc/passwd").read_text()
        assert "dialout:x:20:fruit-station" in (system / "etc/group").read_text()

    again = install("--root", system, "--environment", environment)
    assert again.returncode == 0, again.stdout
    assert tree_of(system) == installed
    assert "made " not in again.stdout, "the release was made again"

    (system / "var/lib/fruit-station/active_recipe.json").write_text("{}")
    unit = system / "etc/systemd/system/fruit-station.service"
    unit.write_text(unit.read_text() + "# mine\n")
    for _ in range(2):
        done = install("--root", system, "--undo")
        assert done.returncode == 0, done.stdout
    assert (system / "var/lib/fruit-station/active_recipe.json").exists()
    assert (system / "etc/fruit-station/station.yaml").exists()
    assert not (system / "opt").exists()
    saved = unit.with_name("fruit-station.service.saved")
    assert saved.read_text().endswith("# mine\n")
    saved.unlink()

    assert install("--root", system, "--undo", "--purge").returncode == 0
    left = {name for name in tree_of(system).keys() - before.keys() if not (system / name).is_dir()}
    assert not left
    assert {name: content for name, content in tree_of(system).items() if name in before} == before


def test_a_dry_run_says_the_steps_and_does_none(system, install, tree_of):
    before = tree_of(system)
    for arguments in ((), ("--undo", "--purge")):
        done = install("--root", system, "--dry-run", *arguments)
        assert done.returncode == 0, done.stdout
        assert "would " in done.stdout
    assert tree_of(system) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rollback"], "there is no upgrade to take back"),
        (["--purge"], "--purge goes with --undo"),
        (["--root", "/nowhere/at/all"], "is no folder"),
    ],
)
def test_what_cannot_be_done_is_refused_in_words(tmp_path, install, arguments, words):
    refused = install("--root", tmp_path, *arguments)
    assert refused.returncode == 2
    assert words in refused.stdout
    assert "Traceback" not in refused.stderr
    assert not list(tmp_path.iterdir())


def test_a_machine_that_cannot_is_refused_with_the_remedy(tmp_path, installer, monkeypatch):
    refused = installer("messages").Refused
    checks, layout = installer("preflight"), installer("layout").Layout
    with monkeypatch.context() as patch:
        patch.setattr(checks.os, "geteuid", lambda: 1000)
        with pytest.raises(refused, match="sudo deploy/install"):
            checks.check_machine(layout(Path("/")))
    with monkeypatch.context() as patch:
        patch.setattr(checks.importlib.util, "find_spec", lambda _name: None)
        with pytest.raises(refused, match="apt-get install python3-venv"):
            checks.check_machine(layout(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(checks.os, "geteuid", lambda: 0)
        patch.setattr(checks.shutil, "which", lambda _name: None)
        with pytest.raises(refused, match="apt-get install passwd systemd util-linux"):
            checks.check_machine(layout(Path("/")))
    with monkeypatch.context() as patch:
        patch.setattr(checks.os, "geteuid", lambda: 0)
        patch.setattr(checks.shutil, "which", lambda name: f"/usr/bin/{name}")
        patch.setattr(checks.sys, "executable", "/usr/bin/python3.12")
        patch.setattr(checks.sys, "base_prefix", "/home/ida/uv/python3.12")
        with pytest.raises(refused, match=r"cannot run /home/ida/uv/python3\.12: it is in a person's home"):
            checks.check_machine(layout(Path("/")))
        patch.setattr(checks.sys, "base_prefix", "/usr")
        checks.check_machine(layout(Path("/")))
    with monkeypatch.context() as patch:
        patch.setattr(checks.shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(10**9, 9 * 10**8, 10**8))
        with pytest.raises(refused, match="has 100 MB of free space, 1500 MB are needed"):
            checks.check_disk_space(layout(tmp_path), installer("release").ROOM_BYTES, migrates=False)


def test_a_migration_of_the_records_needs_room_for_two_copies_of_the_database_and_for_its_rollback(
    tmp_path, root, installer, monkeypatch
):
    checks, layout = installer("preflight"), installer("layout").Layout(tmp_path)
    source, services = installer("release").Source(root), installer("services").ScratchRoot(layout)
    installation = installer("installation").Installation(layout, services, source, installer("release").Packages())
    assert source.schema_version == ScriptDirectory(str(MIGRATIONS)).get_current_head()
    (layout.home / "records").mkdir(parents=True)

    def begin(schema):
        (layout.home / "records/records.sqlite3").unlink(missing_ok=True)
        with closing(sqlite3.connect(layout.home / "records/records.sqlite3")) as connection:
            connection.executescript(
                f"CREATE TABLE alembic_version (version_num); INSERT INTO alembic_version VALUES ('{schema}'); "
                "CREATE TABLE fruit (data); INSERT INTO fruit VALUES (zeroblob(2000000))"
            )

    free_bytes = installer("release").ROOM_BYTES + 7_000_000
    monkeypatch.setattr(checks.shutil, "disk_usage", lambda _path: shutil._ntuple_diskusage(10**12, 0, free_bytes))
    begin(source.schema_version)
    installation.check(during_lot=True)
    begin("0001")
    with pytest.raises(installer("messages").Refused, match="has 1507 MB of free space, 1508 MB are needed"):
        installation.check(during_lot=True)


def test_fruit_of_the_last_minutes_is_a_lot_under_way(tmp_path, installer, monkeypatch):
    checks, layout = installer("preflight"), installer("layout").Layout(tmp_path)
    checks.check_no_lot(layout, tmp_path)  # nothing was ever recorded
    (layout.home / "records").mkdir(parents=True)
    (layout.home / "records/records.sqlite3").touch()
    rows = ["number  begun (UTC)"]
    monkeypatch.setattr(checks, "station", lambda *words: "\n".join(rows) if "--from" in words else "A-16: M, ended")
    checks.check_no_lot(layout, tmp_path)
    rows.append("4711    2026-06-30")
    with pytest.raises(installer("messages").Refused, match="inspected within the last 10 minutes: stop the line"):
        checks.check_no_lot(layout, tmp_path)


def test_no_python_is_said_by_the_shell(tmp_path, root):
    done = subprocess.run(
        [root / "deploy/install", "--help"], env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    for tool in ("dirname", "readlink", "sh"):
        (tmp_path / tool).symlink_to(shutil.which(tool) or "")
    done = subprocess.run(
        [root / "deploy/install", "--help"], env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "apt-get install python3 python3-venv" in done.stderr
    assert "UV_PYTHON_INSTALL_DIR=/opt/python pipx run uv python install 3.12" in done.stderr


def test_a_python_that_uv_installed_is_run_where_it_is_and_not_by_its_link_in_a_home(tmp_path, root):
    bin_folder, home, elsewhere = (tmp_path / name for name in ("bin", "home/.local/bin", "opt"))
    for folder in (bin_folder, home, elsewhere):
        folder.mkdir(parents=True)
    for tool in ("dirname", "readlink", "sh"):
        (bin_folder / tool).symlink_to(shutil.which(tool) or "")
    program = elsewhere / "python3.12"
    program.write_text('#!/bin/sh\n[ "$1" = -c ] || echo "$0"\n')
    program.chmod(0o755)
    (home / "python3.12").symlink_to(program)
    environment = {"PATH": str(bin_folder), "HOME": str(tmp_path / "home")}
    done = subprocess.run([root / "deploy/install"], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{program}\n"), done.stderr


def test_a_part_of_the_project_is_no_source(tmp_path, root, install):
    shutil.copytree(root / "deploy", tmp_path / "deploy")
    (tmp_path / "root").mkdir()
    refused = install("--root", tmp_path / "root", program=tmp_path)
    assert refused.returncode == 2
    assert "has no pyproject.toml" in refused.stdout


def test_two_installers_do_not_work_at_once(tmp_path, install):
    (tmp_path / "opt/fruit-station").mkdir(parents=True)
    folder = os.open(tmp_path / "opt/fruit-station", os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        refused = install("--root", tmp_path, "--undo")
    finally:
        os.close(folder)
    assert refused.returncode == 2
    assert "another installer is at work" in refused.stdout
