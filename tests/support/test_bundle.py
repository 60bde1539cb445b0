"""Support bundle: what is in it, what never is, and that a broken station gives one too."""

import io
import json
import os
import subprocess
import sys
import zipfile

import pytest
from click.testing import CliRunner

from hmi.web.app import make_context
from hmi.web.command import hmi
from station.settings.last_good import load_or_last_good

SECRET = "hunter2-and-more"


def station(home, *arguments, **more):
    environment = {**os.environ, **more, "STATION_HOME": str(home), "STATION_METRICS_PORT": "1"}
    command = [sys.executable, "-m", "station", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=environment)


@pytest.fixture
def home(tmp_path):
    """A home folder with logs, a setting, and secrets beside them."""
    home = tmp_path / "home"
    (home / "logs").mkdir(parents=True)
    (home / "logs" / "service.log").write_text("x" * 3_000_000 + "the last line\n")
    (home / "hmi").mkdir()
    (home / "hmi" / "people.json").write_text(json.dumps({"anna": SECRET}))
    (home / "outbox-password").write_text(SECRET)
    (home / "station.yaml").write_text(
        "modbus: {unit: 7}\noutbox: {postgresql: {enabled: true, host: db, password_file: outbox-password}}\n"
    )
    return home


def test_it_has_what_support_needs_and_nothing_secret(home, tmp_path):
    done = station(home, "support", "--out", tmp_path / "s.zip")
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(tmp_path / "s.zip") as archive:
        parts = {name: archive.read(name).decode() for name in archive.namelist()}
    assert json.loads(parts["configuration.json"])["modbus"]["unit"] == 7
    assert "pymodbus==" in parts["packages.txt"]
    assert {"recipes/raspberry.yaml", "recipes/strawberry.yaml"} <= parts.keys()
    assert parts["logs/service.log"].endswith("the last line\n")
    assert len(parts["logs/service.log"]) == 2_000_000
    assert [name for name, text in parts.items() if SECRET in text] == []
    assert not any("people" in name for name in parts)
    for name in ("readyz.txt", "alarms.json", "inspections.txt"):
        assert parts[name].startswith("not available: "), parts[name]


def test_a_file_that_is_there_is_not_overwritten(home, tmp_path):
    (tmp_path / "s.zip").write_text("mine")
    done = station(home, "support", "--out", tmp_path / "s.zip")
    assert (done.returncode, (tmp_path / "s.zip").read_text()) == (2, "mine")
    assert "name a new file with --out" in done.stderr


def parts_of(file):
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def test_a_broken_configuration_gives_its_error_and_the_last_good_one(home, tmp_path, monkeypatch):
    monkeypatch.setenv("STATION_HOME", str(home))
    load_or_last_good(None)
    (home / "station.yaml").write_text("modbus: {unit: seven}\n")
    done = station(home, "support", "--out", tmp_path / "s.zip")
    assert done.returncode == 0, done.stderr
    parts = parts_of(tmp_path / "s.zip")
    assert "modbus.unit" in parts["configuration_error.txt"]
    assert json.loads(parts["configuration.json"])["modbus"]["unit"] == 7
    assert parts["logs/service.log"].endswith("the last line\n")


def test_the_pages_bundle_has_the_error_too(home, monkeypatch):
    made = []

    async def serve(*arguments):
        made.append(await make_context(*arguments).past.support_bundle())

    for name, does in (("configure_logging", lambda *_: None), ("serve", serve)):
        monkeypatch.setattr(f"hmi.web.command.{name}", does)
    monkeypatch.setenv("STATION_HOME", str(home))
    for text in ("modbus: {unit: 7}\n", "modbus: {unit: seven}\n"):
        (home / "station.yaml").write_text(text)
        assert CliRunner().invoke(hmi, catch_exceptions=False).exit_code == 0
    good, broken = (parts_of(io.BytesIO(file)) for file in made)
    assert "configuration_error.txt" not in good
    assert "modbus.unit" in broken["configuration_error.txt"]


def test_a_configuration_that_was_never_good_gives_its_error_too(home, tmp_path):
    (home / "station.yaml").write_text("modbus: {unit: seven}\n")
    done = station(home, "support", "--out", tmp_path / "s.zip")
    assert done.returncode == 0, done.stderr
    parts = parts_of(tmp_path / "s.zip")
    assert "modbus.unit" in parts["configuration_error.txt"]
    assert json.loads(parts["configuration.json"])["home"] == str(home)


def test_an_installed_stations_log_and_last_backup_are_in_it(home, tmp_path):
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "journalctl").write_text('#!/bin/sh\necho "journal of $*"\n')
    (tmp_path / "bin" / "journalctl").chmod(0o755)
    (home / "last_backup").touch()
    os.utime(home / "last_backup", (1_782_790_452, 1_782_790_452))
    done = station(home, "support", "--out", tmp_path / "s.zip", PATH=f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr
    parts = parts_of(tmp_path / "s.zip")
    assert "--unit=fruit-station --unit=fruit-station-backup" in parts["logs/journal.txt"]
    assert "backup       2026-06-30 03:34:12 UTC" in parts["about.txt"]


def test_without_a_journal_the_bundle_says_so(home, tmp_path):
    done = station(home, "support", "--out", tmp_path / "s.zip", PATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert parts_of(tmp_path / "s.zip")["logs/journal.txt"].startswith("not available: ")


@pytest.mark.parametrize("arguments", [("support", "--out"), ("grip", "--recipe", "raspberry", "--out")])
def test_a_file_that_the_system_refuses_is_named_with_the_reason(home, arguments):
    name = "n" * 300
    done = station(home, *arguments, name)
    assert done.returncode == 1
    assert f"{name}: " in done.stderr
    assert "File name too long" in done.stderr
    assert "Traceback" not in done.stderr
