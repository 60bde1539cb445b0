"""Small programs to supervise, each with a word for what it does wrong."""

import asyncio
import functools
import logging
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from station.supervision.supervisor import Program, Supervisor
from tests import eventually

CHILD = """
import asyncio, os, signal, sys, time
from pathlib import Path
from station.supervision.notify import feed_watchdog, notify

folder, name, *how = sys.argv[1:]
folder = Path(folder)
with (folder / "log").open("a") as log:
    log.write(f"start {name} {os.getpid()}\\n")
if "dies" in how:
    sys.exit(3)
if "deaf" in how:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)

async def main():
    ended = asyncio.Event()
    if "deaf" not in how:
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    feeding = asyncio.create_task(feed_watchdog(lambda: not (folder / f"{name}.hang").exists()))
    if "slow" in how:
        notify("EXTEND_TIMEOUT_USEC=60000000")
        while not (folder / f"{name}.go").exists():
            await asyncio.sleep(0.02)
    if "mute" not in how:
        notify("READY=1")
    await ended.wait()
    feeding.cancel()
    with (folder / "log").open("a") as log:
        log.write(f"end {name}\\n")

asyncio.run(main())
"""


class Bench:
    """A supervisor with its programs, run in a loop of its own."""

    def __init__(self, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
        self.folder, self.caplog, self.ready = folder, caplog, False
        (folder / "child.py").write_text(CHILD, encoding="utf-8")

    def program(self, name: str, *how: str, **limits: float) -> Program:
        limits = {"start_limit_s": 20.0, "watchdog_s": 5.0, "stop_limit_s": 20.0} | limits
        command = (sys.executable, str(self.folder / "child.py"), str(self.folder), name, *how)
        return Program(name, command, limits["start_limit_s"], limits["watchdog_s"], limits["stop_limit_s"])

    def log(self) -> list[str]:
        path = self.folder / "log"
        return [line.rsplit(" ", 1)[0] if line.startswith("start") else line for line in path.read_text().splitlines()]

    def pids(self, name: str) -> list[int]:
        lines = (self.folder / "log").read_text().splitlines()
        return [int(line.split()[2]) for line in lines if line.startswith(f"start {name} ")]

    def run(self, programs: list[Program], play: Callable[[Supervisor, asyncio.Event], Awaitable[object]]) -> None:
        """Supervise until `play`, which begins when all are ready, sets the event or the supervisor gives up."""

        async def supervise() -> None:
            supervisor, ended, ready = Supervisor(programs), asyncio.Event(), asyncio.Event()
            running = asyncio.create_task(supervisor.run(ready.set, ended))
            waiting = asyncio.create_task(ready.wait())
            await asyncio.wait([running, waiting], return_when=asyncio.FIRST_COMPLETED)
            if ready.is_set():
                self.ready = True
                await play(supervisor, ended)
            waiting.cancel()
            await running

        with self.caplog.at_level(logging.ERROR):
            asyncio.run(supervise())


@pytest.fixture
def bench(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> Bench:
    return Bench(tmp_path, caplog)


@pytest.fixture
def until() -> Callable[..., Awaitable[Any]]:
    return functools.partial(eventually.until, patience_s=30.0)
