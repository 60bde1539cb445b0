"""A round of the kills over the wire."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

_PROGRAM = Path(__file__).resolve().parents[2] / "benchmarks" / "bench_kills.py"
_CARRIED = "7030"
"""Seed of a station whose service is killed while the arm carries a bruised fruit, and again while that is held."""


@pytest.mark.timeout(300)
def test_a_fruit_that_the_arm_carries_is_held_over_two_kills_and_the_records_are_whole():
    command = [sys.executable, str(_PROGRAM), "--wire", "2", "--seed", _CARRIED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    made, station = (json.loads(line) for line in done.stdout.splitlines() if line.startswith("{"))
    assert [(kill["process"], kill["moment"]) for kill in made["kills"]] == [
        ("service", "release"),
        ("service", "held"),
    ]
    assert made["outcome"] in {"FAIL", "NO_RESULT"}, "a starved machine may be late to judge it, and it is carried too"
    assert made["held"] == "fruit between the jaws"
    assert (made["wrong"], station["wrong"], station["inspections"]) == ([], [], 1)
