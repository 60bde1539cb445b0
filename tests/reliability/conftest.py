"""The fault matrix's command, as a person runs it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def bench_faults(tmp_path: Path) -> Callable[..., tuple[int, str, str]]:
    """Run `./run bench faults` with these arguments, without changing the page; exit code, output, errors."""

    def run(*arguments: object) -> tuple[int, str, str]:
        command = [sys.executable, str(ROOT / "benchmarks" / "bench_faults.py"), "--dry", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False, cwd=tmp_path)
        return done.returncode, done.stdout, done.stderr

    return run
