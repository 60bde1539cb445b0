"""The real `station plc run`, a scripted station behind its channel, and a PLC on the wire."""

import asyncio
import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymodbus.client import AsyncModbusTcpClient

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import step
from plc_interface.handshake.state import restarted
from plc_interface.registers.codec import WordOrder, decode, encode
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    Line,
    Noted,
    Open,
    Outcome,
    PackmlState,
    Published,
    Reason,
    Refusal,
    Resume,
    StationState,
)
from station.channel.server import ChannelServer
from station.settings.plc import HandshakeSettings

PATIENCE_S = 30.0
COMMAND = (sys.executable, "-m", "station", "plc", "run")


async def until(condition: Callable[[], Any], what: str = "") -> Any:
    """Poll, with a deadline, until a condition gives something true."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not (met := condition()):
        assert time.monotonic() < deadline_s, f"never came: {what or condition}"
        await asyncio.sleep(0.01)
    return met


class ScriptedStation:
    """Answers the channel as a station does. Its records outlive its process; a test says how it judges."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.boots = 0
        self.begun: dict[int, Begin] = {}
        self.outcomes: dict[int, Outcome] = {}
        self.published: dict[int, Outcome] = {}
        self.acknowledged = 0
        self.running: int | None = None
        self.lines: list[Line] = []
        self.commands: list[Command] = []
        self.healthy = True
        self.refusal: Refusal | None = None
        self.deadline_s = 60.0
        self.command_gate = asyncio.Event()
        self.command_gate.set()
        self.command_done = CommandDone(done=True, why=None)
        self.deaf = False
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        self.boots += 1
        if self.running is not None:
            self.finish("NO_RESULT", Reason.STATION_LOST)
        handlers = {
            Begin: self._begin,
            AwaitOutcome: self._await,
            Published: self._published,
            Acknowledged: self._acknowledged,
            Resume: self._resume,
            Line: self._line,
            Command: self._command,
        }
        server = ChannelServer(self.endpoint, handlers)
        self._task = asyncio.create_task(server.serve(), name="scripted station")

    async def die(self) -> None:
        """As if killed: nothing is answered any more."""
        if self._task:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    def finish(self, name: str = "PASS", *reasons: Reason, **changes: Any) -> Outcome:
        """End the running inspection."""
        assert self.running is not None
        sequence, self.running = self.running, None
        begin = self.begun[sequence]
        measured = name != "NO_RESULT"
        values: dict[str, Any] = {
            "sequence": sequence,
            "trigger_id": begin.trigger_id,
            "outcome": name,
            "reasons": reasons,
            "late": False,
            "partial": not measured,
            "simulated": True,
            "area_mm2": 12.34 if measured else None,
            "area_px": 567 if measured else None,
            "closing_mm": 1.5 if measured else None,
            "confidence": 0.9 if measured else None,
            "recipe_number": 3,
            "recipe_checksum": 0x12345678,
            "began_utc_ms": 1_700_000_000_000,
            "ended_utc_ms": 1_700_000_000_900,
            "duration_ms": 900,
            "encoder": begin.encoder,
            "lot": begin.lot,
            "fruit_length_mm_x10": begin.fruit_length_mm_x10,
            "size_class": begin.size_class,
        }
        self.outcomes[sequence] = Outcome.model_validate(values | changes)
        return self.outcomes[sequence]

    async def _begin(self, request: Begin) -> BeginReply:
        await until(lambda: not self.deaf)
        if self.refusal or self.running:
            return BeginReply(refusal=self.refusal or Refusal.BUSY)
        sequence = max(self.begun, default=100) + 1
        self.begun[sequence] = request
        self.running = sequence
        return BeginReply(sequence=sequence, deadline_s=self.deadline_s)

    async def _await(self, request: AwaitOutcome) -> Outcome:
        return await until(lambda: self.outcomes.get(request.sequence))

    async def _published(self, request: Published) -> Noted:
        self.published[request.outcome.sequence] = request.outcome
        if self.running == request.outcome.sequence:
            self.running = None
        return Noted()

    async def _acknowledged(self, request: Acknowledged) -> Noted:
        self.acknowledged = max(self.acknowledged, request.sequence)
        return Noted()

    async def _resume(self, _request: Resume) -> Open:
        stands = self.outcomes | self.published
        running = (self.running, self.begun[self.running].trigger_id) if self.running else None
        ended = tuple(stands[sequence] for sequence in sorted(stands) if sequence > self.acknowledged)
        return Open(running=running, outcomes=ended)

    async def _line(self, request: Line) -> StationState:
        self.lines.append(request)
        return StationState(
            boot=f"boot {self.boots}",
            healthy=self.healthy,
            ready=self.running is None,
            why_not_ready=None,
            packml_state=PackmlState.EXECUTE,
            mode=1,
            recipe_number=3,
            recipe_checksum=0x12345678,
            error_code=0,
            alarms=0b101,
            simulated=True,
        )

    async def _command(self, request: Command) -> CommandDone:
        self.commands.append(request)
        await self.command_gate.wait()
        return self.command_done


class Plc:
    """Writes and reads by the map's names, one request each."""

    def __init__(self, port: int, order: WordOrder) -> None:
        self._client = AsyncModbusTcpClient("127.0.0.1", port=port, timeout=10, retries=0)
        self._order = order
        self.control: set[str] = set()

    async def connect(self) -> None:
        assert await self._client.connect()
        await self.write(write_key=0x5AFE)

    def close(self) -> None:
        self._client.close()

    async def write(self, **values: int | str) -> None:
        """Neighbours go in one request."""
        exception = await self.try_write(**values)
        assert exception == 0, f"exception {exception} for {values}"

    async def try_write(self, **values: int | str) -> int:
        """The exception code, 0 for none. What lies apart from the control bits goes before them."""
        runs: list[tuple[int, list[int]]] = []
        for register in sorted((BY_NAME[name] for name in values), key=lambda register: register.address):
            words = list(encode(register, values[register.name], self._order))
            if runs and runs[-1][0] + len(runs[-1][1]) == register.address:
                runs[-1][1].extend(words)
            else:
                runs.append((register.address, words))
        for address, words in reversed(runs):
            answer = await self._client.write_registers(address, words)
            if answer.isError():
                return answer.exception_code
        return 0

    async def set(self, *bits: str, **values: int | str) -> None:
        """Raise control bits, with other values in the same request where they are neighbours."""
        self.control |= set(bits)
        await self.write(control=BY_NAME["control"].flags(self.control), **values)

    async def drop(self, *bits: str) -> None:
        self.control -= set(bits)
        await self.write(control=BY_NAME["control"].flags(self.control))

    async def arm(self, *bits: str) -> None:
        self.control = set()
        await self.write(control=0)
        await self.set("enable", *bits)
        await self.wait("trigger_ready")

    async def trigger(self, trigger_id: int, encoder: int = 0) -> dict[str, Any]:
        """One whole trigger by levels; what stood in the status when it was acknowledged."""
        await self.write(encoder=encoder)
        await self.set("trigger", trigger_id=trigger_id)
        seen = await self.wait("trigger_acknowledged")
        await self.drop("trigger")
        await self.wait(without="trigger_acknowledged")
        return seen

    async def read(self) -> dict[str, Any]:
        """Status and result in one request, decoded; flags as sets of names."""
        status, result = GROUP_BY_NAME["status"], GROUP_BY_NAME["result"]
        answer = await self._client.read_holding_registers(status.address, count=status.words + result.words)
        assert not answer.isError()
        return self._decoded((*status.registers, *result.registers), status.address, answer.registers)

    async def counters(self) -> dict[str, Any]:
        group = GROUP_BY_NAME["counters"]
        answer = await self._client.read_input_registers(group.address, count=group.words)
        return self._decoded(group.registers, group.address, answer.registers)

    def _decoded(self, registers: Any, start: int, words: Sequence[int]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for register in registers:
            value = decode(register, words[register.address - start : register.end - start], self._order)
            if register.bits:
                value = register.names(int(value))
            elif register.codes:
                value = register.codes[int(value)].name
            values[register.name] = value
        return values

    async def wait(self, *bits: str, without: str = "", **values: Any) -> dict[str, Any]:
        """Poll until status bits are set (and one is not) and values are as given."""
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            seen = await self.read()
            met = set(bits) <= seen["status"] and without not in seen["status"]
            if met and all(seen[name] == value for name, value in values.items()):
                return seen
            assert time.monotonic() < deadline_s, f"never came: {bits}, not {without!r}, {values}; last {seen}"
            await asyncio.sleep(0.01)


class Cell:
    """One interface's process, its station and its PLCs."""

    def __init__(self, home: Path, port: int, **settings: object) -> None:
        self.home, self.port = home, port
        self.order = WordOrder(settings.get("modbus_word_order", "high_first"))
        self.station = ScriptedStation(f"ipc://{home}/run/line.ipc")
        self.process: asyncio.subprocess.Process | None = None
        self.log = home / "plc.log"
        self._plcs: list[Plc] = []
        self._environment = {name: text for name, text in os.environ.items() if not name.startswith("STATION_")} | {
            "STATION_HOME": str(home),
            "STATION_MODBUS_PORT": str(port),
            **{f"STATION_{name.upper()}": str(value) for name, value in settings.items()},
        }
        (home / "run").mkdir()

    async def start(self) -> None:
        """Start the interface and wait until it serves."""
        with self.log.open("ab") as log:
            self.process = await asyncio.create_subprocess_exec(*COMMAND, env=self._environment, stderr=log)
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            with contextlib.suppress(OSError):
                _, writer = await asyncio.open_connection("127.0.0.1", self.port)
                writer.close()
                return
            assert self.process.returncode is None, self.log.read_text()
            assert time.monotonic() < deadline_s, "it does not listen"
            await asyncio.sleep(0.05)

    async def start_another(self) -> tuple[int, str]:
        """Exit code and message of one that is started beside it."""
        other = await asyncio.create_subprocess_exec(
            *COMMAND, env=self._environment, stderr=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
        )
        _, said = await asyncio.wait_for(other.communicate(), PATIENCE_S)
        assert other.returncode is not None
        return other.returncode, said.decode()

    async def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """Signal the interface and give its exit code."""
        assert self.process is not None
        if self.process.returncode is None:
            self.process.send_signal(number)
        return await self.process.wait()

    async def plc(self) -> Plc:
        made = Plc(self.port, self.order)
        await made.connect()
        self._plcs.append(made)
        return made

    async def close(self) -> None:
        for plc in self._plcs:
            plc.close()
        if self.process is not None:
            await self.end(signal.SIGKILL)
        await self.station.die()


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """A folder whose sockets' paths are short enough."""
    folder = Path(tempfile.mkdtemp(prefix="hs"))
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def cell(short_folder: Path, unused_port: int) -> Callable[..., contextlib.AbstractAsyncContextManager[Cell]]:
    """A cell that runs; settings by their variables' names without STATION_."""

    @contextlib.asynccontextmanager
    async def running(**settings: object) -> AsyncIterator[Cell]:
        made = Cell(short_folder, unused_port, **settings)
        await made.station.start()
        try:
            await made.start()
            yield made
        finally:
            await made.close()

    return running


@pytest.fixture
def eventually() -> Callable[..., Any]:
    """See `until`."""
    return until


class Bench:
    """The pure handshake with a clock that a test sets; answers are given by hand."""

    def __init__(self, journal: Journal | None = None) -> None:
        self.now_s = 100.0
        self.settings = HandshakeSettings()
        self.state = restarted(journal or Journal(), self.at(), self.settings.station_lost_after_s)
        self.inputs = ev.Inputs()
        self.actions: list[do.Action] = []

    def at(self) -> ev.Moment:
        return ev.Moment(self.now_s, round(1000 * self.now_s))

    def feed(self, kind: Any, *arguments: Any, **named: Any) -> tuple[do.Action, ...]:
        self.state, actions = step(self.state, kind(self.at(), *arguments, **named), self.settings)
        self.actions += actions
        return actions

    def write(self, *bits: str, **values: Any) -> tuple[do.Action, ...]:
        """The control bits as they are to be now, and other fields."""
        self.inputs = replace(self.inputs, control=frozenset(bits), **values)
        return self.feed(ev.PlcWrote, self.inputs, frozenset({"control", *values}))

    def station_state(self, **changes: Any) -> StationState:
        state = StationState(
            boot="1",
            healthy=True,
            ready=True,
            why_not_ready=None,
            packml_state=None,
            mode=1,
            recipe_number=0,
            recipe_checksum=0,
            error_code=0,
            alarms=0,
            simulated=False,
        )
        return state.model_copy(update=changes)

    def link(self, opened: Open | None = None, **changes: Any) -> tuple[do.Action, ...]:
        """A beat, and the answer to what it asks."""
        self.feed(ev.Beat, self.station_state(**changes))
        assert self.state.open_request is not None
        return self.feed(ev.OpenAnswered, self.state.open_request, opened or Open(running=None, outcomes=()))

    def armed(self, *bits: str) -> None:
        self.feed(ev.WriterGranted)
        self.link()
        self.write()
        self.write("enable", *bits)

    def run(self, trigger_id: int = 7, sequence: int = 41) -> None:
        """An accepted trigger."""
        self.armed()
        self.write("enable", "trigger", trigger_id=trigger_id)
        assert self.state.pending is not None
        self.feed(ev.BeginAnswered, self.state.pending.number, BeginReply(sequence=sequence, deadline_s=2.0))

    def of(self, kind: type[Any]) -> list[Any]:
        return [action for action in self.actions if isinstance(action, kind)]

    def outcome(self, name: str = "PASS", *reasons: Reason, **changes: Any) -> Outcome:
        running = ScriptedStation("")
        running.running, running.begun = 41, {41: Begin(trigger_id=7, encoder=0, lot="")}
        return running.finish(name, *reasons, **changes)


@pytest.fixture
def bench() -> type[Bench]:
    return Bench
