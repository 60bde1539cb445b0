"""A PostgreSQL and an MQTT broker of the test's own, and records with many inspections."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from benchmarks.archive import many, postgres
from tests.hosts import fresh_host
from tests.ports import free_port
from tests.tools import required

LIMIT_S = 60.0


@pytest.fixture(scope="session")
def server(postgresql_programs: Path) -> Iterator[postgres.Server]:
    """A running PostgreSQL with our tables."""
    with postgres.throwaway(postgresql_programs, fresh_host()) as started:
        yield started


@pytest.fixture
def fill() -> Callable[..., None]:
    """Write many inspections into a records' folder."""
    return many.fill


@pytest.fixture
def broker(tmp_path: Path) -> Iterator["Broker"]:
    """A running mosquitto that wants a password."""
    required("mosquitto")
    running = Broker(tmp_path)
    running.start()
    yield running
    running.stop()


class Broker:
    """A mosquitto in a folder of the test's."""

    user, password = "station", "not for the log"

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.password_file = folder / "mqtt-password"
        self.password_file.touch(0o600)
        self.password_file.write_text(self.password + "\n")
        known = folder / "passwords"
        known.touch(0o600)
        subprocess.run(["mosquitto_passwd", "-b", known, self.user, self.password], check=True, capture_output=True)
        self._configuration = folder / "mosquitto.conf"
        self._configuration.write_text(
            f"listener {self.port} 127.0.0.1\nallow_anonymous false\npassword_file {known}\nuser root\n"
        )
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self._process = subprocess.Popen(["mosquitto", "-c", self._configuration], stdout=-3, stderr=-3)
        until_s = time.monotonic() + LIMIT_S
        while time.monotonic() < until_s:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.02)
        pytest.fail("mosquitto does not listen")

    def stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._process = None


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `station …` as a user does, with the home `tmp_path`."""

    def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "station", *map(str, arguments)],
            capture_output=True, text=True, timeout=100, check=False,
            env={**os.environ, "STATION_HOME": str(tmp_path), **environment},
        )  # fmt: skip

    return run
