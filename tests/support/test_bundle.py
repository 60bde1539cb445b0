"""Support bundle: what is in it, what never is, and that a broken station gives one too."""

import json
import os
import subprocess
import sys
import zipfile

import pytest

SECRET = "hunter2-and-more"


def station(home, *arguments):
    environment = {**os.environ, "STATION_HOME": str(home), "STATION_METRICS_PORT": "1"}
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
