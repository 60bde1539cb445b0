"""A whole station against the twin, its processes supervised, with faults to be switched on in it."""

import asyncio
import contextlib
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import psutil

from plc_interface.client import StationClient
from plc_interface.client.errors import ClientError
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.registers.codec import WordOrder
from station.channel.client import ChannelClient
from station.channel.panel import Actor
from station.channel.panel_run import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Program, Supervisor
from station.twin.console import ask

from .clock import CannotDoError, ShiftedClock
from .quick_recipe import JUDGED, values_with
from .routes import Routes
from .scenario import ClockFault, DeviceFault, DiskFault, Fault, NestFault, Phase, PlcFault, ProcessFault, Scenario
from .wire import Wire

LOOPBACK = "127.0.0.1"
FRUIT = "blueberry"
_SEED = 1
_DISK_MB = 24
_MARKS = {
    "service": "-m station service",
    "plc": "-m station plc run",
    "hmi": "-m station hmi",
    "arm": "-m station.devices.arm.process",
}
_DEFORMED_MM = 0.5
_CLOSED_BY_MM = 0.5
_LEAVES_SLOWER = 9.0
_SWEEPS_SLOWER = 2.0
"""A sweep takes 0.15 s, in which a busy machine neither sees the phase nor measures enough frames for a PASS."""
_JAWS_OPEN_MM = 50.0
_START_S = 120.0
_FIRST_PORT, _PORTS_END = 20_000, 30_000
_STOP_S = 10.0


class Rig:
    """One running station.

    Args:
        configuration: its own.
        file: of the configuration.
        console_port: of the twin.
        plc_host: where the line's PLC finds the interface, if elsewhere than its own address.
    """

    def __init__(
        self, configuration: Configuration, file: Path, console_port: int, plc_host: str | None = None
    ) -> None:
        self.configuration, self.records = configuration, configuration.home / "records"
        self._file, self._console = file, console_port
        self._ballast = self.records / "ballast"
        self.clock = ShiftedClock(file.parent)
        self._stopped: list[psutil.Process] = []
        self.recipe = load_recipes(configuration.recipes_folder)[FRUIT]
        modbus = configuration.modbus
        scanner = Scanner(plc_host or modbus.host, modbus.port, modbus.unit, WordOrder(modbus.word_order))
        self.wire = Wire(scanner, lambda: self.twin(do="remove"))
        self._watching: asyncio.subprocess.Process | None = None
        self._moving: asyncio.Task[bytes] | None = None

    async def twin(self, **request: Any) -> Any:
        """Send a request to the twin's console."""
        return await asyncio.to_thread(ask, LOOPBACK, self._console, request)

    async def lay_and_trigger(self, *, bruised: bool = False) -> None:
        """Bring a good fruit, or a bruised one, and trigger; the line has to be ready."""
        await self.twin(do="fruit", kind=FRUIT, seed=_SEED, bruised=bruised)
        self.wire.trigger()

    async def jaws_open(self) -> bool:
        """Return whether the jaws are open, by the twin's truth."""
        return (await self.twin(do="state"))["width_mm"] > _JAWS_OPEN_MM

    async def watch_arm(self) -> None:
        """Look out for the arm's motion, as a client of its controller beside the station."""
        script = Path(__file__).with_name("arm_motion.py")
        self._watching = await asyncio.create_subprocess_exec(
            sys.executable, str(script), self.configuration.arm.host, stdout=asyncio.subprocess.PIPE
        )
        output = self._watching.stdout
        if output is None or await output.readline() != b"watching\n":
            raise CannotDoError("the arm's controller takes no second client")
        self._moving = asyncio.create_task(output.readline(), name="arm's motion")

    async def unwatch_arm(self) -> None:
        """End that. Idempotent."""
        if self._watching is not None:
            with contextlib.suppress(ProcessLookupError):
                self._watching.kill()
            await self._watching.wait()
        if self._moving is not None:
            await self._moving
        self._watching = self._moving = None

    async def leave_slowly(self) -> None:
        """Wait for the result, and have the arm take ten times as long for its way from the fruit."""
        while not self.wire.result_valid:
            await asyncio.sleep(0.01)
        await self.twin(do="set", device="arm", fault="slow", amount=_LEAVES_SLOWER)

    async def hurry(self) -> None:
        """Have the arm move as ever. Idempotent."""
        await self.twin(do="clear", device="arm", fault="slow")

    async def reached(self, phase: Phase, accepted_before: int) -> bool:
        """Return whether the cycle has reached a phase.

        Args:
            phase: of this fruit's cycle.
            accepted_before: number of triggers accepted before this fruit.
        """
        if len(self.wire.accepted) <= accepted_before:
            return False
        if phase is Phase.APPROACH:
            return self._moving is not None and self._moving.done()
        if phase is Phase.STEPPING:
            return (await self.twin(do="state"))["closing_mm"] > _DEFORMED_MM
        if phase is Phase.CLOSING:
            around_mm = self.recipe.expected_width.largest_mm + self.configuration.arm.jaw_clearance_mm
            return (await self.twin(do="state"))["width_mm"] < around_mm - _CLOSED_BY_MM
        return phase is not Phase.RELEASING or self.wire.result_valid

    async def begin(self, fault: Fault) -> None:
        """Switch a fault on.

        Raises:
            CannotDoError: not on this machine.
        """
        if isinstance(fault, DeviceFault):
            await self.twin(do="set", device=fault.device, fault=fault.fault, amount=fault.amount)
        elif isinstance(fault, ProcessFault):
            process = self._process(fault.process)
            process.send_signal(signal.Signals[fault.signal])
            if fault.signal == "SIGSTOP":
                self._stopped.append(process)
        elif isinstance(fault, ClockFault):
            self.clock.step(fault.step_s)
        elif isinstance(fault, NestFault):
            await self.twin(do="remove")
        elif isinstance(fault, PlcFault):
            self.wire.disturb(fault.plc)
        elif fault.disk == "full":
            with contextlib.suppress(OSError), self._ballast.open("wb", buffering=0) as ballast:
                while True:
                    ballast.write(bytes(4096))
        else:
            await self._make_read_only()

    async def end(self, fault: Fault) -> None:
        """Take a fault back. Idempotent."""
        if isinstance(fault, DeviceFault):
            await self.twin(do="clear", device=fault.device, fault=fault.fault)
        elif isinstance(fault, ProcessFault):
            for process in self._stopped:
                with contextlib.suppress(psutil.NoSuchProcess):
                    process.resume()
            self._stopped.clear()
        elif isinstance(fault, ClockFault):
            self.clock.step(0)
        elif isinstance(fault, NestFault):
            return
        elif isinstance(fault, PlcFault):
            self.wire.disturb(None)
        elif fault.disk == "full":
            self._ballast.unlink(missing_ok=True)
        else:
            await self._mount("-o", "remount,rw", str(self.records))

    async def mount_records(self) -> None:
        """Give the records a small disk of their own.

        Raises:
            CannotDoError: mounting is not permitted.
        """
        self.records.mkdir(parents=True, exist_ok=True)
        await self._mount("-t", "tmpfs", "-o", f"size={_DISK_MB}m", "tmpfs", str(self.records))

    async def unmount_records(self) -> None:
        """Take it away. Idempotent."""
        if self.records.is_mount():
            await asyncio.to_thread(subprocess.run, ["umount", "--lazy", str(self.records)], check=False)

    async def why_not_ready(self) -> str:
        """The station's own sentence; empty where it is ready or does not answer."""
        address = f"http://{LOOPBACK}:{self.configuration.metrics.port}/readyz"
        return await asyncio.to_thread(_why, address)

    async def carry_out(self, remedy: str) -> bool:
        """Do what a person does. Whether it worked."""
        if remedy == "reset":
            return await self.wire.reset()
        if remedy == "start":
            return (await self._order_at_the_panel(OperatorCommandName.START)).state != "failed"
        command = [sys.executable, "-m", "station", "devices", *remedy.split(), "--yes", "--config", str(self._file)]
        done = await asyncio.to_thread(subprocess.run, command, capture_output=True, timeout=90, check=False)
        return done.returncode == 0

    async def stop_at_the_panel(self) -> bool:
        """Stop the station as a person does. Whether the pages show it."""
        await self._order_at_the_panel(OperatorCommandName.STOP)
        endpoint = panel_endpoint(self.configuration.hmi, self.configuration.home)
        async with ChannelClient(endpoint, "the station") as panel:
            ends_s = time.monotonic() + _STOP_S
            while time.monotonic() < ends_s:
                if (await panel.request(GetPanelState(), PanelState, deadline_s=_STOP_S)).stopping:
                    return True
        return False

    async def _order_at_the_panel(self, name: OperatorCommandName) -> OperatorCommandView:
        endpoint = panel_endpoint(self.configuration.hmi, self.configuration.home)
        order = OperatorCommand(person=Actor(who="bench", role="operator"), order=name)
        async with ChannelClient(endpoint, "the station") as panel:
            return await panel.request(order, OperatorCommandView, deadline_s=_STOP_S)

    async def choose_recipe(self) -> None:
        """Make the fruit's recipe the active one, then give the right to write away."""
        modbus = self.configuration.modbus
        async with StationClient(modbus.host, modbus.port, unit=modbus.unit) as client:
            await client.arm()
            async with asyncio.timeout(60):
                while True:
                    try:
                        await client.change_recipe(self.recipe.plc_number)
                        break
                    except ClientError:
                        await asyncio.sleep(0.2)
            await client.disarm()

    async def _make_read_only(self) -> None:
        """Kill the service and be quicker than its restart, which opens the files again."""
        for last in (False, False, True):
            with contextlib.suppress(CannotDoError):
                service = self._process("service")
                service.kill()
                await asyncio.to_thread(psutil.wait_procs, [service], timeout=5)
            try:
                await self._mount("-o", "remount,ro", str(self.records))
            except CannotDoError:
                if last:
                    raise
            else:
                return

    def _process(self, name: str) -> psutil.Process:
        mark = _MARKS[name]
        for process in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                line = " ".join(process.cmdline())
                if process.environ().get("STATION_HOME") == str(self.configuration.home) and mark in line:
                    return process
        raise CannotDoError(f"there is no process {name} now")

    async def _mount(self, *arguments: str) -> None:
        done = await asyncio.to_thread(
            subprocess.run, ["mount", *arguments], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise CannotDoError(f"mounting is not permitted here: {done.stderr.strip()}")


def _why(address: str) -> str:
    try:
        with urllib.request.urlopen(address, timeout=2) as answer:
            body = answer.read()
    except urllib.error.HTTPError as error:
        body = error.read()
    except OSError:
        return ""
    try:
        return str(json.loads(body).get("why", ""))
    except ValueError:
        return ""


def _free_ports(count: int) -> list[int]:
    """Ports that no connection takes while a killed process is away: below those of outgoing connections."""
    ports = list[int]()
    while len(ports) < count:
        port = _FIRST_PORT + secrets.randbelow(_PORTS_END - _FIRST_PORT)  # tests seed `random`, all alike
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind((LOOPBACK, port))
            ports += [] if port in ports else [port]
    return ports


def _quick_recipes(folder: Path, measured: str, limit_mm2: float) -> Path:
    """The shipped recipe with few steps: the matrix is about faults, not about fruit."""
    folder.mkdir()
    changes = {
        "steps.number": 6,
        "steps.result_closings_mm": [3],
        "steps.closing_limit_mm": 6.0,
        "steps.measured": measured,
        "imaging.settle_s": 0.05,
        "imaging.frames_per_step": 2,
        **JUDGED,
    }
    values = values_with(load_recipes()[FRUIT], changes)
    values["damage"]["area"][-1]["area_mm2"] = limit_mm2
    (folder / f"{FRUIT}.yaml").write_text(json.dumps(values), encoding="utf-8")
    return folder


class _Files(NamedTuple):
    """The configuration of each side."""

    twin: Path
    station: Path
    plc: Path


def _detoured(file: Path, values: dict[str, Any], host: str, channel: tuple[str, int]) -> _Files:
    """Write a configuration for each side: the station finds every device, and the interface the station, at `host`."""
    twin, plc = file.with_name("twin.yaml"), file.with_name("plc.yaml")
    twin.write_text(json.dumps(values), encoding="utf-8")
    gripper = {**values["gripper"], "urcap": {"host": host}}
    camera = {**values["camera"], "twin": {**values["camera"]["twin"], "host": host}}
    devices = {"arm": {**values["arm"], "host": host}, "gripper": gripper, "camera": camera}
    for each, address in ((file, channel[0]), (plc, host)):
        line = {"handshake": {"endpoint": f"tcp://{address}:{channel[1]}"}}
        each.write_text(json.dumps({**values, **devices, **line}), encoding="utf-8")
    return _Files(twin, file, plc)


def _programs(files: _Files, console: int, logs: Path) -> list[Program]:
    """The cell's processes, each by its own configuration."""
    service, _, pages = station_programs(files.station, logs)
    plc = station_programs(files.plc, logs)[1]
    programs = [twin_program(files.twin, console, 1, logs), service, plc, pages]
    return [replace(each, start_limit_s=_START_S) for each in programs]


def _patient(host: str, camera: int, placing: str) -> dict[str, Any]:
    """Devices and service with the patience of a busy machine.

    Args:
        host: of the devices.
        camera: its port.
        placing: the service's setting.
    """
    return {
        "arm": {
            "host": host,
            "frequency_hz": 125.0,
            "stale_after_s": 1.0,
            "link_lost_after_s": 2.0,
            "watchdog_hz": 0.5,
            "constructor_limit_s": 30.0,
        },
        "gripper": {
            "urcap": {"host": host},
            "modbus_rtu": {"host": host},
            "answer_timeout_s": 2.0,
            "move_margin_s": 10.0,
        },
        "camera": {"oldest_s": 2.0, "twin": {"port": camera}},
        "records": {"free_reserve_mb": 1},
        "service": {
            "patience": 5.0,
            "inspection_deadline_s": None,
            "retry_longest_s": 1.0,
            "uncalibrated": "allow",
            "placing": placing,
        },
    }


@contextlib.asynccontextmanager
async def running(
    folder: Path,
    scenario: Scenario,
    placing: Literal["nest", "arm"] = "nest",
    limit_mm2: float = 140.0,
    routes: Routes | None = None,
) -> AsyncIterator[Rig]:
    """Start a station on addresses of its own, with the patience of a busy machine; it ends with the block.

    Args:
        folder: an empty one.
        scenario: what will be played; the station is prepared for it.
        placing: the service's setting.
        limit_mm2: the recipe's, of the contact area.
        routes: proxies that every link leads through; None for none.

    Raises:
        CannotDoError: the fault's disk or clock cannot be had.
        StationError: a process does not start.
    """
    modbus, metrics, hmi, camera, console, line = _free_ports(6)
    host = f"127.{96 + secrets.randbelow(16)}.{secrets.randbelow(250) + 1}.{secrets.randbelow(250) + 1}"
    file = folder / "station.yaml"
    values = {
        "home": str(folder / "home"),
        "recipes_folder": str(_quick_recipes(folder / "recipes", scenario.measured, limit_mm2)),
        "modbus": {"port": modbus},
        "metrics": {"port": metrics},
        "hmi": {"port": hmi},
        **_patient(host, camera, placing),
    }
    file.write_text(json.dumps(values), encoding="utf-8")
    behind = configuration = load_configuration(file, {})
    files = _Files(file, file, file)
    if routes is not None:
        files = _detoured(file, values, routes.host, (host, line))
        configuration = load_configuration(file, {})
    logs = folder / "logs"
    logs.mkdir()
    rig = Rig(configuration, file, console, None if routes is None else routes.host)
    environment = {**os.environ, "STATION_HOME": str(folder / "home"), "OMP_NUM_THREADS": "1"}
    if isinstance(scenario.fault, ClockFault):
        environment |= rig.clock.build()
    programs = _programs(files, console, logs)
    supervisor = Supervisor(programs, environment)
    ended, ready = asyncio.Event(), asyncio.Event()
    if isinstance(scenario.fault, DiskFault):
        await rig.mount_records()
    supervising = asyncio.create_task(supervisor.run(ready.set, ended), name="supervisor")
    waiting = asyncio.create_task(ready.wait())
    scanning: asyncio.Task[None] | None = None
    through = contextlib.AsyncExitStack()
    try:
        if routes is not None:
            await through.enter_async_context(routes.opened(behind, (host, line)))
        await asyncio.wait([supervising, waiting], return_when=asyncio.FIRST_COMPLETED)
        if supervising.done():
            await supervising
        await rig.twin(do="remove")
        if scenario.measured == "while_closing":
            await rig.twin(do="set", device="gripper", fault="slow", amount=_SWEEPS_SLOWER)
        await rig.choose_recipe()
        scanning = asyncio.create_task(rig.wire.run(), name="scanning")
        yield rig
    finally:
        await rig.unwatch_arm()
        waiting.cancel()
        if scanning is not None:
            rig.wire.stop()
            await asyncio.gather(scanning, return_exceptions=True)
        ended.set()
        await asyncio.gather(supervising, return_exceptions=True)
        await through.aclose()
        await rig.unmount_records()
