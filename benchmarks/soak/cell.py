"""The station of the soak with all that it works with: twin, line, panels, PostgreSQL and an MQTT broker."""

import asyncio
import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from archive.many import fill
from archive.postgres import PORT, Server, programs, throwaway
from bench_plc import HOST, wait_for
from hmi_load.rounds import clients
from monitoring.ports import free_port

from plc_interface.plc_simulator.nest import LaidFruit, TwinNest
from plc_interface.plc_simulator.program import LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.commands.simulated_unit import calibrate_simulated_unit
from station.records.database import records_folder
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Supervisor

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("strawberry", "raspberry", "blueberry")
DEVICES = "127.0.0.84"
"""An address of the loopback for the twin's devices, as their ports are fixed."""
PANELS, READERS = 3, 2
BATCH = 20
"""Fruit of one kind in a row; then the line changes the recipe."""
DAMAGED_SHARE, ACCEPTED_SHARE = 0.2, 0.5
"""Of the fruit; and of the images of passed ones that are stored. Shipped are 2 %, of a line with few damaged ones: so
images come and go some five times as often."""
QUOTA_MB = 40
"""The images of some eight inspections."""
EARLIER = 8 * 60 * 18
"""Inspections in the records before the first: eight hours at 18 fruit a minute, which PostgreSQL has yet to get."""
CLOSING_MM_S = 40
"""Of the jaws, twice the shipped recipes': more fruit a minute."""
SEED = 2026
_START_S = 120.0


class Cell(NamedTuple):
    """Running parts of the soak: the station with its PostgreSQL, the bare server and the line."""

    site: Configuration
    server: Server
    bare_port: int
    """Of a Modbus server of the station's with no station behind it."""
    line: LineSimulator
    running: asyncio.Task[object]
    """The line; ends only by an error."""


class Batches:
    """A nest that gets one kind of fruit after the other, some of each in a row.

    Args:
        nests: one for each kind.
    """

    def __init__(self, nests: list[TwinNest]) -> None:
        self._nests, self._fruit = nests, 0

    async def arrive(self) -> LaidFruit:
        """Lay the next fruit."""
        nest = self._nests[self._fruit // BATCH % len(self._nests)]
        self._fruit += 1
        return await nest.arrive()

    async def leave(self) -> None:
        """Empty the nest, which is the same for all."""
        await self._nests[0].leave()


def quick_recipes(folder: Path) -> Path:
    """Return the shipped recipes with a quicker closing, as a folder of their own.

    Args:
        folder: where to.
    """
    place = folder / "recipes"
    shutil.copytree(ROOT / "recipes", place)
    for kind in KINDS:
        file = place / f"{kind}.yaml"
        text, times = re.subn(r"(?m)^  speed_mm_s: \d+", f"  speed_mm_s: {CLOSING_MM_S}", file.read_text("utf-8"))
        if times != 1:
            raise SystemExit(f"{file}: expected one speed_mm_s")
        file.write_text(text, encoding="utf-8")
    return place


@contextlib.contextmanager
def broker(folder: Path) -> Iterator[int]:
    """A mosquitto of one's own, which anybody on this machine may use; gives its port.

    Args:
        folder: for its configuration.
    """
    program = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
    port, file = free_port(), folder / "mosquitto.conf"
    file.write_text(f"listener {port} {HOST}\nallow_anonymous true\nlog_dest none\n", encoding="utf-8")
    with _serving(port, program, "-c", file):
        yield port


@contextlib.contextmanager
def bare_server() -> Iterator[int]:
    """The PLC's server in a process of its own, with nothing behind it; gives its port."""
    port = free_port()
    with _serving(port, sys.executable, "-c", f"import bench_plc; bench_plc.serve_ours({port}, priority=True)"):
        yield port


@contextlib.contextmanager
def _serving(port: int, *command: str | Path) -> Iterator[None]:
    # A session of its own: Ctrl-C is the soak's, which ends all in their order. So with every process here.
    process = subprocess.Popen(command, cwd=ROOT / "benchmarks", stdout=subprocess.DEVNULL, start_new_session=True)
    try:
        wait_for(port)
        yield
    finally:
        process.kill()
        process.wait()


def configuration(folder: Path, server: Server, broker_port: int) -> tuple[Path, Configuration]:
    """Write the station's configuration; gives its file, and itself.

    Args:
        folder: for everything.
        server: the PostgreSQL.
        broker_port: of the MQTT broker.
    """
    values = {
        "home": str(folder / "home"),
        "recipes_folder": str(quick_recipes(folder)),
        "modbus": {"port": free_port()},
        "metrics": {"port": free_port()},
        "hmi": {"port": free_port()},
        # A desktop computer is no real-time controller, and a slightly old state can harm no arm here.
        "arm": {"host": DEVICES, "stale_after_s": 1.0, "link_lost_after_s": 2.0},
        "gripper": {"urcap": {"host": DEVICES}, "modbus_rtu": {"host": DEVICES}, "answer_timeout_s": 2.0},
        "camera": {"oldest_s": 2.0, "twin": {"port": free_port()}},
        "records": {"images_quota_mb": QUOTA_MB, "accepted_share": ACCEPTED_SHARE},
        "service": {"patience": 5.0, "inspection_deadline_s": None},
        "outbox": {
            "station": "soak",
            "longest_pause_s": 1.0,
            "postgresql": {
                "enabled": True,
                "host": str(server.folder),
                "port": PORT,
                "user": "fruit",
                "tls": "disable",
            },
            "mqtt": {"enabled": True, "host": HOST, "port": broker_port},
        },
    }
    file = folder / "station.yaml"
    file.write_text(json.dumps(values), encoding="utf-8")
    return file, load_configuration(file, {})


@contextlib.asynccontextmanager
async def running() -> AsyncIterator[Cell]:
    """Run the whole cell with fruit after fruit; nothing of it remains after the block.

    Raises:
        StationError: a process does not start.
        SystemExit: a program is missing, or a page does not answer.
    """
    bin_folder = programs()
    if bin_folder is None:
        raise SystemExit("PostgreSQL's programs are missing: apt-get install postgresql")
    async with contextlib.AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        server = stack.enter_context(throwaway(bin_folder))
        file, site = configuration(folder, server, stack.enter_context(broker(folder)))
        bare_port = stack.enter_context(bare_server())
        await asyncio.to_thread(prepare, site)
        console_port = free_port()
        await stack.enter_async_context(supervised(file, site, console_port))
        for who, count in (("panels", PANELS), ("readers", READERS)):
            load = clients(who, count, site.hmi.host, site.hmi.port)
            # Not on this loop, which feeds the supervisor, until the first of them is answered.
            await asyncio.to_thread(load.__enter__)
            stack.push(load.__exit__)
        line, task = await stack.enter_async_context(feeding(site, console_port))
        yield Cell(site, server, bare_port, line, task)


def prepare(site: Configuration) -> None:
    """Calibrate the simulated sensor, and fill the records."""
    calibrate_simulated_unit(site, "bench")
    fill(records_folder(site.home), 1, EARLIER, steps=4)


@contextlib.asynccontextmanager
async def supervised(file: Path, site: Configuration, console_port: int) -> AsyncIterator[None]:
    """The twin and the station's processes, ready.

    Args:
        file: the configuration's.
        site: what is in it.
        console_port: of the twin.

    Raises:
        StationError: one does not start.
    """
    logs = site.home / "logs"
    logs.mkdir()
    parts = [twin_program(file, console_port, SEED, logs), *station_programs(file, logs, outbox=True)]
    environment = {**os.environ, "STATION_HOME": str(site.home), "OMP_NUM_THREADS": "1"}
    supervisor = Supervisor([replace(each, start_limit_s=_START_S) for each in parts], environment)
    ended, ready = asyncio.Event(), asyncio.Event()
    supervising = asyncio.create_task(supervisor.run(ready.set, ended), name="supervisor")
    waiting = asyncio.create_task(ready.wait())
    try:
        await asyncio.wait([supervising, waiting], return_when=asyncio.FIRST_COMPLETED)
        if supervising.done():
            await supervising
        yield
    finally:
        waiting.cancel()
        ended.set()
        await asyncio.gather(supervising, return_exceptions=True)


@contextlib.asynccontextmanager
async def feeding(site: Configuration, console_port: int) -> AsyncIterator[tuple[LineSimulator, asyncio.Task[object]]]:
    """A line that lays fruit after fruit, as fast as the station takes them.

    Args:
        site: the station's.
        console_port: of the twin.
    """
    numbers = {name: recipe.plc_number for name, recipe in load_recipes(site.recipes_folder).items()}
    nests = [
        TwinNest(console_port, {kind: numbers[kind]}, DAMAGED_SHARE, SEED + place) for place, kind in enumerate(KINDS)
    ]
    modbus = site.modbus
    async with Scanner(modbus.host, modbus.port, modbus.unit, WordOrder(modbus.word_order)) as scanner:
        line = LineSimulator(LineProgram(lot="SOAK"), scanner, Batches(nests), Pace())
        task = asyncio.create_task(line.run(None), name="line")
        try:
            yield line, task
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
