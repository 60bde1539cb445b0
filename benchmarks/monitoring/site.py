"""A demonstration as a person starts it, with a calibrated sensor, an outbox into a real PostgreSQL, and Prometheus."""

import json
import math
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from station.calibration.model import Calibration, FieldMap, Noise, Verification, stamp
from station.calibration.store import CalibrationStore
from station.records.database import FILE_NAME

from .ports import free_ports
from .prometheus import Prometheus, running, write_configuration

STATION = "station-1"
SEED = 71
"""Of which the first two fruits are sound and the third is not."""
WEEK = "3s"
"""How long a week is for a demonstration, which has not been running for one."""
_LIMIT_S = 400.0
"""Before a test's own limit, so that the logs are printed."""
_PATIENT = """
import functools
from station.supervision import programs
programs.Program = functools.partial(programs.Program, start_limit_s=200.0)
from station.cli import main
main()
"""
"""The command line, for a machine so busy that a process does not start within the supervisor's usual limit."""


@dataclass(frozen=True, slots=True)
class Site:
    """A demonstration that has ended, and what was heard of it."""

    prometheus: Prometheus
    metrics: str
    """Its /metrics, after the last fruit."""
    began_s: float
    at_s: float
    """When that was; nothing was scraped much later."""


@contextmanager
def demonstration(folder: Path, server: Any, fruits: int, host: str) -> Iterator[Site]:
    """Run the demonstration under a Prometheus that is still there when it has ended.

    Args:
        folder: for everything.
        server: the PostgreSQL, with our tables.
        fruits: how many are inspected.
        host: a loopback address of its own for arm and gripper.
    """
    modbus, metrics, hmi, camera, console = free_ports(5)
    values = {
        "modbus": {"port": modbus},
        "metrics": {"port": metrics},
        "hmi": {"port": hmi},
        # At the shipped 2 Hz the controller stops the program of a station that a busy machine lets wait half a second,
        # and a person may have to start it again.
        "arm": {"host": host, "stale_after_s": 1.0, "link_lost_after_s": 4.0, "watchdog_hz": 0.5},
        "gripper": {"urcap": {"host": host}, "modbus_rtu": {"host": host}, "answer_timeout_s": 2.0},
        "camera": {"oldest_s": 2.0, "twin": {"port": camera}},
        "handshake": {"station_lost_after_s": 30.0},
        "records": {"free_reserve_mb": 1},
        "outbox": {
            "station": STATION,
            "longest_pause_s": 0.5,
            "postgresql": {"enabled": True, "host": str(server.folder), "user": "fruit", "tls": "disable"},
        },
        "service": {"patience": 10.0, "inspection_deadline_s": None},
    }
    file = folder / "station.yaml"
    file.write_text(json.dumps(values))
    home = folder / "demo"
    home.mkdir()
    _calibrated(home, f"TWIN-{camera}")
    environment = {
        **os.environ, "STATION_HOME": str(folder), "STATION_CONFIG": str(file), "OMP_NUM_THREADS": "1",
    }  # fmt: skip
    station, patient = [sys.executable, "-m", "station"], [sys.executable, "-c", _PATIENT]
    database = home / "records" / FILE_NAME
    options = ["--console", str(console), "--fruit", "blueberry", "--damaged", "0.4", "--seed", str(SEED)]
    configuration = write_configuration(folder, "1s", {STATION: f"127.0.0.1:{metrics}"})
    with ExitStack() as stack:
        prometheus = stack.enter_context(running(folder, configuration))
        began_s = time.time()
        demo = stack.enter_context(_process([*patient, "demo", *options], folder / "demo.log", environment))
        _until(demo, database.exists, folder)
        at_home = {**environment, "STATION_HOME": str(home)}
        stack.enter_context(_process([*station, "outbox", "run"], folder / "outbox.log", at_home))
        _until(demo, lambda: _decided(prometheus) >= fruits and _published(server) >= fruits, folder)
        _until(demo, lambda: _scraped_often(prometheus) and _has_a_week(prometheus), folder)
        with urllib.request.urlopen(f"http://127.0.0.1:{metrics}/metrics", timeout=30) as answer:
            text, at_s = answer.read().decode(), time.time()
        demo.send_signal(signal.SIGTERM)
        demo.wait(60)
        yield Site(prometheus, text, began_s, at_s)


def _until(demo: subprocess.Popen[bytes], holds: Callable[[], bool], folder: Path) -> None:
    """Wait for something while the demonstration runs."""
    until_s = time.monotonic() + _LIMIT_S
    while not holds():
        if demo.poll() is not None or time.monotonic() > until_s:
            logs = [file.read_text()[-2000:] for file in sorted(folder.glob("*.log"))]
            raise RuntimeError(f"the demonstration ended early, or hangs: {logs}")
        time.sleep(0.5)


@contextmanager
def _process(command: list[str], log: Path, environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, env=environment)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _decided(prometheus: Prometheus) -> float:
    found = prometheus.now("sum(station_inspections_total)")
    return found[0].points[0][1] if found else 0.0


def _scraped_often(prometheus: Prometheus) -> bool:
    """Return whether even the newest count was scraped three times, and so seen unchanged: before, it has no rate."""
    found = prometheus.now("min(count_over_time(station_inspections_total[5m]))")
    return bool(found) and found[0].points[0][1] >= 3


def _has_a_week(prometheus: Prometheus) -> bool:
    """Return whether the reject rate was known a "week" ago; on a busy machine the last fruit's comes late."""
    found = prometheus.now(f"station_fruit:reject_ratio:1h offset {WEEK}")
    return any(not math.isnan(each.points[0][1]) for each in found)


def _published(server: Any) -> int:
    with server.connect() as connection:
        return connection.execute("SELECT count(*) FROM inspections WHERE outcome IS NOT NULL").fetchone()[0]


def _calibrated(home: Path, serial: str) -> None:
    """As if the sensor had been calibrated weeks ago and verified today; its golden reference is still to be taken."""
    now = datetime.now(UTC)
    calibration = Calibration(
        id=stamp(now - timedelta(days=20)), serial=serial, unit="twin", operator="demonstration", simulated=True,
        program="0", ball_mm=24.0, holder_mm=18.0, width_px=240, height_px=320, mm_per_px=0.0266,
        scale_uncertainty=0.02, scale_measured=True, places=(), curve=(), onset_mm=42.0, zero_mm=0.0,
        noise=Noise(pixel_levels=(1.0, 1.0, 1.0), gate=0.5, gate_factor=1.0, drift_levels=1.0),
        light_levels=(90.0, 90.0, 90.0), sharpness_levels=2.0,
        field=FieldMap(rows=1, columns=1, light_levels=((90.0, 90.0, 90.0),), noise_levels=(1.0,)), checks=(),
    )  # fmt: skip
    verification = Verification(
        id=stamp(now - timedelta(hours=5)), serial=serial, calibration=calibration.id, operator="demonstration",
        passed=True, area_ratio=0.98, onset_mm=42.0, checks=(), curve=(),
    )  # fmt: skip
    store = CalibrationStore(home)
    store.add_calibration(calibration, {})
    store.add_verification(verification, {})
