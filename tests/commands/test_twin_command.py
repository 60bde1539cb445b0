"""`station twin` as a person uses it."""

import os
import resource
import subprocess
import sys
from typing import Any

import pytest

WITHOUT_COVERAGE = {name: value for name, value in os.environ.items() if not name.startswith("COV")}
"""The environment of a program whose files are limited in size: the coverage's own file would be, too."""


def station(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "station", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, **options)


def test_faults_and_fruit_from_the_command_line(make_cell, station_here):
    console = ("--console", make_cell("--bench").console)
    assert "camera: sound" in station_here("twin", "fault", *console).stdout
    assert "lens_fogged" in station_here("twin", "fault", "camera", *console).stdout
    assert station_here("twin", "fault", "camera", "dirt", "--amount", 3, *console).stdout == "camera: dirt 3\n"
    assert "camera: dirt 3" in station_here("twin", "fault", *console).stdout
    assert station_here("twin", "fault", "camera", "dirt", "--clear", *console).stdout == "camera: sound\n"
    assert "raspberry 4" in station_here("twin", "lay", "raspberry", "--seed", 4, *console).stdout
    refused = station_here("twin", "fault", "camera", "cold", *console)
    assert refused.returncode == 2
    assert "it knows: off, stuck" in refused.stderr


def test_a_second_twin_on_the_same_addresses_is_refused(make_cell):
    cell = make_cell()
    second = cell.station("twin", "--console", 0)
    assert second.returncode == 2
    assert "is another twin running?" in second.stderr
    assert "Traceback" not in second.stderr
    assert cell.station("devices", "check").returncode == 0


@pytest.mark.parametrize("fruit", ["strawberry", "raspberry", "blueberry", "rubber_ball"])
def test_a_drawn_press_is_the_same_each_time_and_grows(fruit, tmp_path):
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder in folders:
        done = station("twin", "press", "--fruit", fruit, "--steps", 3, "--out", folder)
        assert done.returncode == 0, done.stderr
    files = sorted(path.relative_to(folders[0]) for path in folders[0].rglob("*") if path.is_file())
    assert len(files) == 5 + 5 + 5 + 1
    assert all((folders[0] / file).read_bytes() == (folders[1] / file).read_bytes() for file in files)


def test_a_press_is_never_drawn_over_another(tmp_path):
    (tmp_path / "frames").mkdir()
    refused = station("twin", "press", "--out", tmp_path)
    assert refused.returncode == 2
    assert "name a new folder" in refused.stderr


def test_a_full_disk_ends_a_drawn_press_with_a_remedy(tmp_path):
    """The limit on a file's size simulates a full disk."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    out = tmp_path / "press"
    done = station("twin", "press", "--steps", 1, "--out", out, preexec_fn=limit, env=WITHOUT_COVERAGE)
    assert done.returncode == 2
    assert "reference_0.png: cannot be written" in done.stderr
    assert "free space and name a new folder" in done.stderr
    assert "Traceback" not in done.stderr
