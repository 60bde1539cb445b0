"""Timing-bound tests, again and again on busy cores: which of them pass by luck.

A test is timing-bound if it reads a clock, sets a deadline, or waits for something within one. A round runs all of
them in random order, with so many at once that each has the others as its load. Every round is stored at once, and
the same command goes on until there are a hundred. Writes docs/flaky-tests.md.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree as ET

import sections
from reliability.flaky import Round, failures, played, timing_bound
from revision import commit

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "flaky-tests.md"
ROUNDS_FILE = Path(__file__).resolve().parent / "reliability" / "flaky_rounds.json"
ROUNDS = 100
_AT_ONCE = 3
"""Tests a core. With six a core, each core had eight processes to run at a time."""
_LOAD_EVERY_S = 10.0


def play(seed: int) -> Round:
    """Run all of them once.

    Raises:
        SystemExit: pytest ran no test, or was interrupted.
    """
    began_s, loads = time.monotonic(), []
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        workers = _AT_ONCE * (os.cpu_count() or 1)
        command = [sys.executable, "-m", "pytest", "-q", "-n", str(workers), "-p", "benchmarks.reliability.together"]
        command += [f"--randomly-seed={seed}", f"--junitxml={report}", *timing_bound(ROOT / "tests")]
        with subprocess.Popen(command, cwd=ROOT) as running:
            while True:
                try:
                    code = running.wait(_LOAD_EVERY_S)
                    break
                except subprocess.TimeoutExpired:
                    loads.append(os.getloadavg()[0])
        if code not in {0, 1}:
            raise SystemExit(f"pytest ended with {code}: nothing is kept of this round")
        tests = list(ET.parse(report).iter("testcase"))
    bad = [each for each in tests if each.find("failure") is not None or each.find("error") is not None]
    return Round(
        date=datetime.now(UTC).date().isoformat(),
        commit=commit(),
        seed=seed,
        tests=len(tests),
        failed=sorted({f"{each.get('classname')}::{each.get('name')}" for each in bad}),
        minutes=round((time.monotonic() - began_s) / 60, 1),
        load=round(sum(loads) / len(loads), 1) if loads else 0.0,
    )


def main() -> None:
    """Play rounds until there are enough, or the time is over, and write the page after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="in all, with those that are kept")
    parser.add_argument("--minutes", type=float, default=60.0, help="no round begins after them")
    options = parser.parse_args()
    rounds: list[Round] = json.loads(ROUNDS_FILE.read_text("utf-8")) if ROUNDS_FILE.exists() else []
    began_s = time.monotonic()
    while len(rounds) < options.rounds and time.monotonic() - began_s < 60 * options.minutes:
        rounds.append(play(rounds[-1]["seed"] + 1 if rounds else 1))
        ROUNDS_FILE.write_text(json.dumps(rounds, indent=1) + "\n", encoding="utf-8")
        machine = f"{os.cpu_count()} cores ({platform.machine()})"
        sections.write(DOCUMENT, {"played": played(rounds, ROUNDS, machine), "failures": failures(rounds)})
        print(f"round {len(rounds)}: {rounds[-1]['minutes']} min, failed: {rounds[-1]['failed'] or 'none'}", flush=True)


if __name__ == "__main__":
    main()
