"""The studies through their commands."""

import subprocess
import sys
from collections.abc import Callable

import pytest

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def station() -> Run:
    """Run a command of the station as a user does."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "station", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=110, check=False)

    return run
