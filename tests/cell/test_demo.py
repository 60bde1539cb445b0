"""`station demo` as a person uses it."""

import csv
import os
import subprocess
import sys

import pytest

from station.commands import demo
from station.errors import StationError


def test_the_demonstration_shows_a_contact_that_grows(tmp_path):
    command = [sys.executable, "-m", "station", "demo"]
    environment = {**os.environ, "STATION_HOME": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    (report,) = tmp_path.glob("demo/*/report/report.html")
    assert report.as_uri() in done.stdout
    with (report.parent / "curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    areas_px = [int(row["area_px"]) for row in rows]
    assert areas_px[:2] == [0, 0]
    assert areas_px[2:] == sorted(areas_px[2:])
    assert min(areas_px[2:]) > 0
    with (report.parent / "results.csv").open(newline="") as file:
        flags = [row["flags"] for row in csv.DictReader(file)]
    assert all("no_contact" in text for text in flags[:2])
    assert set(flags[2:]) == {""}


def test_a_drawing_that_takes_too_long_is_ended_with_a_remedy(monkeypatch, tmp_path):
    monkeypatch.setenv("STATION_HOME", str(tmp_path))
    monkeypatch.setattr(demo, "_DRAWING_TIMEOUT_S", 0.01)
    with pytest.raises(StationError, match=r"more than 0\.01 s.* start the demonstration again"):
        demo.demo.main([], standalone_mode=False)
