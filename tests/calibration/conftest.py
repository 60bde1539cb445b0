"""Balls that are drawn instead of pressed, a simulated bench on the wire, and one stored calibration for many tests."""

import asyncio
import contextlib
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import pytest

from station.calibration.calibration_procedure import CalibrationProcedure, Draft
from station.calibration.model import Verification, stamp
from station.calibration.report import calibration_files
from station.calibration.rig import Place, Progress, Unit
from station.calibration.store import CalibrationStore
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import find_recipe
from station.studies.simulated_rig import SimulatedRig
from station.twin.console import ask
from tests.hosts import fresh_host

UNIT = Unit("T0001", "drawn DIGIT", simulated=True)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    cv2.setNumThreads(1)


@pytest.fixture(scope="session")
def drawn_ball() -> Callable[..., Any]:
    """Makes a drawn ball; see `station/studies/simulated_rig.py`."""
    return SimulatedRig


def calibrate_drawn(ball: Any, *places: tuple[float, float], progress: list[Progress] | None = None) -> Draft:
    """Run a calibration."""
    recipe = find_recipe("rubber_ball")
    report = [].append if progress is None else progress.append
    return asyncio.run(
        CalibrationProcedure(
            ball, UNIT, recipe, CalibrationSettings(), [Place(*place) for place in places], "anna", "0.1", report
        ).run()
    )


@pytest.fixture(scope="session", name="calibrate_drawn")
def calibrate_drawn_fixture() -> Callable[..., Draft]:
    return calibrate_drawn


@pytest.fixture(scope="session")
def draft() -> Draft:
    """A good calibration on two places."""
    cv2.setNumThreads(1)
    return calibrate_drawn(SimulatedRig(1, mm_per_px=0.0285), (-2.5, 0.0), (0.0, 3.0))


@pytest.fixture
def store(tmp_path: Path) -> CalibrationStore:
    return CalibrationStore(tmp_path)


@pytest.fixture
def stored(store: CalibrationStore, draft: Draft) -> CalibrationStore:
    """A store that has the calibration."""
    store.add_calibration(draft.calibration, calibration_files(draft))
    return store


@dataclass
class Site:
    """A running twin on a bench, and the configuration that leads to it."""

    home: Path
    configuration: Path
    serial: str
    console: int

    def twin(self, **request: Any) -> Any:
        return ask("127.0.0.1", self.console, request)

    def command(self, *arguments: object) -> list[str]:
        return [sys.executable, "-m", "station", *map(str, arguments), "--config", str(self.configuration)]

    def station(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, timeout=280, check=False)


@contextlib.contextmanager
def running_twin(folder: Path, port: int, *, bench: bool) -> Iterator[Site]:
    """A twin in a process of its own with the ball in its nest."""
    host = fresh_host()
    configuration = folder / "station.yaml"
    configuration.write_text(
        f"home: home\nservice: {{bench: {str(bench).lower()}, patience: 20.0}}\n"
        f"arm: {{host: {host}, stale_after_s: 1.0, link_lost_after_s: 4.0, watchdog_hz: 0.5, "
        "constructor_limit_s: 60.0}\n"
        f"gripper: {{urcap: {{host: {host}}}, modbus_rtu: {{host: {host}}}, answer_timeout_s: 3.0}}\n"
        f"camera: {{oldest_s: 2.0, open_deadline_s: 20.0, twin: {{port: {port}}}}}\n"
    )
    arguments = ["twin", "--fruit", "rubber_ball", "--console", "0", "--config", str(configuration)]
    command = [sys.executable, "-m", "station", *arguments, *(["--bench"] if bench else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    console = 0
    for line in process.stdout:
        if line.startswith("console"):
            console = int(line.split(":")[1])
        if line.startswith("running"):
            break
    yield Site(folder / "home", configuration, f"TWIN-{port}", console)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 0


@pytest.fixture
def site(tmp_path: Path, unused_port: int) -> Iterator[Site]:
    """A twin on a bench."""
    with running_twin(tmp_path, unused_port, bench=True) as made:
        yield made


@pytest.fixture
def cell(tmp_path: Path, unused_port: int) -> Iterator[Site]:
    """A twin with its arm."""
    with running_twin(tmp_path, unused_port, bench=False) as made:
        yield made


@pytest.fixture
def verification(draft: Draft) -> Verification:
    """One that passed, of the stored calibration."""
    return Verification(
        id=stamp(draft.calibration.made_at),
        serial="T0001",
        calibration=draft.calibration.id,
        operator="anna",
        passed=True,
        area_ratio=0.98,
        onset_mm=41.8,
        checks=(),
        curve=(),
    )
