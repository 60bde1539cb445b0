"""The station's own process, in this one, on a simulated bench: real drivers, a channel client in the PLC's place."""

import asyncio
import contextlib
import itertools
import json
import os
import sys
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest

from plc_interface.client import StationClient
from plc_interface.client.errors import UnreachableError
from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    CommandName,
    Line,
    LineFault,
    Noted,
    Open,
    Outcome,
    Published,
    Resume,
    StationState,
)
from station.devices.gripper import robotiq
from station.inspection.states import State
from station.messages.message import verbatim
from station.runtime.production.plc_commands import MANUAL
from station.runtime.station import Station
from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.settings.recipe import load_recipes
from station.twin.digit import server
from station.twin.process import Twin, TwinOptions
from station.twin.robotiq import model
from tests.eventually import PATIENCE_S, until
from tests.hosts import fresh_host
from tests.ports import free_port
from tests.quick_recipes import NUMBERS, quick_recipes

LINE = Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=())


@dataclass
class LineClient:
    """Client in the place of the PLC interface, with its requests by hand."""

    client: ChannelClient
    ids: Any = field(default_factory=lambda: itertools.count(1))

    async def state(self, *parts: Literal["can", "reject"]) -> StationState:
        faults = tuple(LineFault(part=part, what=verbatim("it is silent")) for part in parts)
        return await self.client.request(LINE.model_copy(update={"faults": faults}), StationState, deadline_s=20)

    async def order(self, command: CommandName, argument: int = 0) -> CommandDone:
        return await self.client.request(Command(command=command, argument=argument), CommandDone, deadline_s=40)

    async def begin(self, trigger_id: int | None = None) -> BeginReply:
        request = Begin(trigger_id=trigger_id or next(self.ids), encoder=7, lot="LOT 1")
        return await self.client.request(request, BeginReply, deadline_s=20)

    async def outcome(self, sequence: int | None) -> Outcome:
        assert sequence is not None
        return await self.client.request(AwaitOutcome(sequence=sequence), Outcome, deadline_s=PATIENCE_S)

    async def publish(self, outcome: Outcome) -> None:
        await self.client.request(Published(outcome=outcome), Noted, deadline_s=20)
        await self.client.request(Acknowledged(sequence=outcome.sequence), Noted, deadline_s=20)

    async def open(self) -> Open:
        return await self.client.request(Resume(), Open, deadline_s=20)

    async def ready(self) -> StationState:
        deadline_s = time.monotonic() + PATIENCE_S
        while not (state := await self.state()).ready:
            assert time.monotonic() < deadline_s, f"not ready within {PATIENCE_S} s: {state}"
            await asyncio.sleep(0.02)
        return state

    async def inspect(self) -> Outcome:
        """One fruit, from a ready station to an acknowledged outcome."""
        await self.ready()
        reply = await self.begin()
        assert reply.refusal is None, await self.state()
        outcome = await self.outcome(reply.sequence)
        await self.publish(outcome)
        return outcome


@dataclass
class Bench:
    """A simulated bench and the station on it."""

    twin: Twin
    station: Station
    line: LineClient
    configuration: Configuration
    running: asyncio.Task[None]

    @property
    def phase(self) -> State:
        assert self.station.service is not None
        return self.station.service.state

    def lay(self, kind: str, seed: int = 1, *, bruised: bool = False, x_mm: float = 0.0, y_mm: float = 0.0) -> None:
        self.twin._lay({"kind": kind, "seed": seed, "bruised": bruised, "x_mm": x_mm, "y_mm": y_mm})

    def at(self, phase: State, do: Callable[[], Any]) -> None:
        """Do something at the moment at which the cycle enters a phase, once."""
        service = self.station.service
        assert service is not None
        entered = service.entered

        def entered_once(state: State, after: State, took_s: float) -> None:
            entered(state, after, took_s)
            if state is phase:
                service.entered = entered
                do()

        service.entered = entered_once

    async def until(self, is_so: Callable[[], Any], patience_s: float = PATIENCE_S) -> None:
        """Wait until something is so; a failure reports the station's state meanwhile."""
        try:
            await until(is_so, patience_s)
        except AssertionError as error:
            service = self.station.service
            assert service is not None
            alarms = sorted(alarm.id for alarm in service.alarms.alarms.active)
            raise AssertionError(f"{error}: {self.phase}, {service._devices.faults}, {alarms}") from error

    async def reach(self, phase: State) -> None:
        """Wait for a phase, however short it is."""
        if self.phase is not phase:
            reached = asyncio.Event()
            self.at(phase, reached.set)
            async with asyncio.timeout(PATIENCE_S):
                await reached.wait()

    async def choose(self, kind: str) -> None:
        """A ready station with a recipe; on a bench a person first confirms that the jaws are clear."""
        self.twin.world.remove()
        await until(lambda: self.phase in {State.UNKNOWN, State.HELD, State.IDLE})
        done = await self.line.order(CommandName.RESET)
        assert done.done, done.why
        done = await self.line.order(CommandName.CHANGE_RECIPE, NUMBERS[kind])
        assert done.done, done.why
        self.lay(kind)


@pytest.fixture
def settings_file(tmp_path: Path) -> Callable[..., Path]:
    """Write a station.yaml for addresses of its own; the station's patience is that of a busy machine."""

    def write(**service: Any) -> Path:
        host = fresh_host()
        values = {
            "home": str(tmp_path / "home"),
            "recipes_folder": str(quick_recipes(tmp_path / "recipes")),
            "arm": {
                "host": host,
                "stale_after_s": 1.0,
                "link_lost_after_s": 4.0,
                "watchdog_hz": 0.5,
                "constructor_limit_s": 60.0,
            },
            "gripper": {
                "urcap": {"host": host},
                "modbus_rtu": {"host": host},
                "answer_timeout_s": 2.0,
                "move_margin_s": 4.0,
            },
            "camera": {"oldest_s": 3.0, "twin": {"port": free_port()}},
            "metrics": {"port": free_port()},
            "records": {"free_reserve_mb": 1},
            "service": {
                "bench": True,
                "retry_longest_s": 0.5,
                "patience": 10.0,
                "inspection_deadline_s": None,
                "uncalibrated": "allow",
                **service,
            },
        }
        file = tmp_path / "station.yaml"
        file.write_text(json.dumps(values))
        return file

    return write


@pytest.fixture
def roomy(settings_file: Callable[..., Path], tmp_path: Path) -> Callable[..., Path]:
    """The same with a limit for strawberries that a large sound one keeps without its size."""

    def write(**service: Any) -> Path:
        file, recipe = settings_file(**service), tmp_path / "recipes" / "strawberry.yaml"
        values = json.loads(recipe.read_text())
        for limit, area_mm2 in zip(values["damage"]["area"], (115, 140), strict=True):
            limit["area_mm2"] = area_mm2
        recipe.write_text(json.dumps(values))
        return file

    return write


@pytest.fixture
def line_client() -> type[LineClient]:
    """Return the class of the client that sends the PLC interface's requests by hand, over a channel."""
    return LineClient


@pytest.fixture
def bench(
    settings_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., contextlib.AbstractAsyncContextManager[Bench]]:
    """Start a simulated bench and a station on it, in this process; both end with the block.

    The jaws' activation, which is two seconds of nearly every test, takes a tenth of them. The camera sends 15 frames a
    second, as the sensor's slower mode does: to draw, send and check 30 is a sixth of these tests' processor time.
    """
    monkeypatch.setattr(server, "FRAMES_PER_S", 15.0)
    monkeypatch.setattr(model, "FASTEST_MM_S", 10 * model.FASTEST_MM_S)
    monkeypatch.setattr(robotiq, "_RESET_HOLD_S", 0.1 * robotiq._RESET_HOLD_S)

    @contextlib.asynccontextmanager
    async def begin(file: Path | None = None, broken: str = "", **service: Any) -> AsyncIterator[Bench]:
        configuration = load_configuration(file or settings_file(**service), {})
        twin = Twin(
            TwinOptions(
                bench=configuration.service.bench,
                arm=configuration.arm,
                gripper=configuration.gripper,
                camera=configuration.camera.twin,
                console_port=0,
            )
        )
        await twin.start()
        station = Station(configuration, broken)
        started = asyncio.Event()
        running = asyncio.create_task(station.run(lambda _port: started.set()), name="station")
        try:
            await asyncio.wait({running, asyncio.create_task(started.wait())}, return_when=asyncio.FIRST_COMPLETED)
            if running.done():
                running.result()
            endpoint = line_endpoint(configuration.handshake, configuration.home)
            async with ChannelClient(endpoint, "the station") as client:
                yield Bench(twin, station, LineClient(client), configuration, running)
        finally:
            station.stop()
            await running
            await twin.stop()

    return begin


@pytest.fixture
def at_ball(
    bench: Callable[..., contextlib.AbstractAsyncContextManager[Bench]],
    settings_file: Callable[..., Path],
    tmp_path: Path,
) -> Callable[..., contextlib.AbstractAsyncContextManager[tuple[Bench, ChannelClient, list[State]]]]:
    """A ready station with the ball in its nest, in manual mode, its panel, and the states that it enters then."""

    @contextlib.asynccontextmanager
    async def begin(**service: Any) -> AsyncIterator[tuple[Bench, ChannelClient, list[State]]]:
        file = settings_file(**service)
        values = load_recipes()["rubber_ball"].model_dump(mode="json")
        values["imaging"]["frames_per_step"] = 1
        (tmp_path / "recipes" / "rubber_ball.yaml").write_text(json.dumps(values))
        async with bench(file) as cell:
            await cell.line.order(CommandName.RESET)  # on a bench a person first confirms that the jaws are clear
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            cell.lay("rubber_ball")
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            runs, entered = cell.station.service, list[State]()
            assert runs is not None
            note = runs.entered

            def noted(state: State, after: State, took_s: float) -> None:
                note(state, after, took_s)
                entered.append(state)

            runs.entered = noted
            endpoint = panel_endpoint(cell.configuration.hmi, cell.configuration.home)
            async with ChannelClient(endpoint, "the station") as panel:
                yield cell, panel, entered

    return begin


@contextlib.asynccontextmanager
async def armed_interface(file: Path) -> AsyncIterator[StationClient]:
    """`station plc run`, and a PLC that is armed."""
    async with interface_at(file) as port, StationClient("127.0.0.1", port, timeout_s=10) as plc:
        await plc.arm()
        yield plc


@contextlib.asynccontextmanager
async def interface_at(file: Path) -> AsyncIterator[int]:
    """`station plc run` with the patience of a busy machine; its port once it answers."""
    port = free_port()
    patience = {"BEGIN_DEADLINE_S": "2.5", "STATION_LOST_AFTER_S": "30", "PLC_HEARTBEAT_TIMEOUT_S": "30"}
    patient = {f"STATION_HANDSHAKE_{name}": value for name, value in patience.items()}
    environment = {**os.environ, **patient, "STATION_MODBUS_PORT": str(port)}
    command = (sys.executable, "-m", "station", "plc", "run", "--config", str(file))
    process = await asyncio.create_subprocess_exec(*command, env=environment)
    try:
        async with asyncio.timeout(60):
            while True:
                with contextlib.suppress(UnreachableError):
                    async with StationClient("127.0.0.1", port, timeout_s=10):
                        break
                await asyncio.sleep(0.1)
        yield port
    finally:
        process.terminate()
        await process.wait()


@pytest.fixture
def plc_port() -> Callable[[Path], contextlib.AbstractAsyncContextManager[int]]:
    """`station plc run` for a station's settings, at a port, with no PLC yet."""
    return interface_at


@pytest.fixture
def plc_interface() -> Callable[[Path], contextlib.AbstractAsyncContextManager[StationClient]]:
    """`station plc run` for a station's settings, and a PLC that is armed."""
    return armed_interface
