"""A whole simulated cell in a process of its own, and the station's command line against it."""

import contextlib
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from station.twin.console import ask
from tests.hosts import fresh_host
from tests.ports import free_port


@dataclass
class Cell:
    """A running twin and the configuration that leads to it."""

    configuration: Path
    console: int
    process: subprocess.Popen[str]

    def twin(self, **request: Any) -> Any:
        return ask("127.0.0.1", self.console, request)

    def station(self, *arguments: object, timeout_s: float = 90) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "station", *map(str, arguments), "--config", str(self.configuration)]
        return subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)

    def begin(self, *arguments: object) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "station", *map(str, arguments), "--config", str(self.configuration)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1)


@contextlib.contextmanager
def started_cells(folder: Path) -> Iterator[Callable[..., Cell]]:
    """Starts a twin with the arguments given; all are ended at the end.

    The station's patience is that of a machine that runs other tests too.
    """
    cells: list[Cell] = []

    def make(*arguments: object) -> Cell:
        host = fresh_host()
        configuration = folder / f"station_{len(cells)}.yaml"
        configuration.write_text(
            f"home: home_{len(cells)}\n"
            f"arm: {{host: {host}}}\n"
            "gripper: {answer_timeout_s: 2.0, move_margin_s: 8.0, "
            f"urcap: {{host: {host}}}, modbus_rtu: {{host: {host}}}}}\n"
            f"camera: {{oldest_s: 1.0, twin: {{port: {free_port()}}}}}\n"
        )
        command = [sys.executable, "-m", "station", "twin", "--console", "0", "--config", str(configuration)]
        process = subprocess.Popen([*command, *map(str, arguments)], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        console = 0
        for line in process.stdout:
            if line.startswith("console"):
                console = int(line.split(":")[1])
            if line.startswith("running"):
                break
        cells.append(Cell(configuration, console, process))
        return cells[-1]

    yield make
    for cell in cells:
        cell.process.send_signal(signal.SIGINT)
        cell.process.communicate(timeout=20)
        assert cell.process.returncode == 0


@pytest.fixture
def make_cell(tmp_path: Path) -> Iterator[Callable[..., Cell]]:
    """Start a twin with the arguments given; it is ended after the test."""
    with started_cells(tmp_path) as make:
        yield make


@pytest.fixture(scope="module")
def shared_cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """A twin for all tests of a module: each leaves it as it was."""
    with started_cells(tmp_path_factory.mktemp("cell")) as make:
        yield make()
