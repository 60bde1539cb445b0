"""The command line as a user meets it."""

import subprocess
import sys


def station(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "station", *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_help_lists_every_command_with_one_line():
    done = station("--help")
    assert done.returncode == 0
    assert "analyze" in done.stdout
