"""The command line as a user meets it."""

import importlib
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from station.cli import COMMANDS, cli


def station(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "station", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_help_lists_every_command_with_one_line():
    done = station("--help")
    assert done.returncode == 0
    lines = [line.split(maxsplit=1) for line in done.stdout.splitlines() if line.startswith("  ")]
    listed = {line[0]: line[1] for line in lines if len(line) == 2}
    assert listed | {name: entry.summary for name, entry in COMMANDS.items()} == listed


def test_help_imports_no_command():
    code = "import sys; from station.cli import main\ntry: main()\nexcept SystemExit: pass\nprint('cv2' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout.splitlines()[-1] == "False"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_there_under_its_name_and_explains_itself(name):
    module, attribute = COMMANDS[name].target.split(":")
    command = getattr(importlib.import_module(module), attribute)
    assert isinstance(command, click.Command)
    assert command.name == name
    assert command.help
    assert CliRunner().invoke(cli, [name, "--help"]).exit_code == 0


@pytest.mark.parametrize("arguments", [("brew",), ("--brew",), ("analyze", "--brew")])
def test_bad_usage_is_exit_code_2_without_a_traceback(arguments):
    done = station(*arguments)
    assert done.returncode == 2
    assert "Usage:" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_version_is_the_distributions():
    assert station("--version").stdout.startswith("station, version 0.")
