"""The real `station plc run`, a scripted station behind its channel, and a PLC on the wire."""

import asyncio
import contextlib
import os
import shutil
import signal
import struct
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from pymodbus.client import AsyncModbusTcpClient

from plc_interface.registers.codec import WordOrder, decode, encode
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME
from tests.plc_interface import scripted_station
from tests.plc_interface.scripted_station import PATIENCE_S, ScriptedStation

COMMAND = (sys.executable, "-m", "station", "plc", "run")
PATIENT = {"handshake_begin_deadline_s": 10.0, "handshake_station_lost_after_s": 30.0}
"""Where no limit is to pass, none does on a busy machine either."""
LIMIT_S = 2.0


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
        """The exception code, 0 for none. Fields apart from the control bits go before them."""
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

    async def beat(self, heartbeat: int, lot: bytes) -> None:
        """Heartbeat, encoder and lot in one request, as a program writes them in each scan; any bytes for the lot."""
        words = struct.unpack(">16H", lot.ljust(32, b"\0"))
        answer = await self._client.write_registers(BY_NAME["plc_heartbeat"].address, [heartbeat, 0, 0, *words])
        assert not answer.isError(), answer

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

    async def group(self, name: str) -> dict[str, Any]:
        group = GROUP_BY_NAME[name]
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
            **{f"STATION_{name.upper()}": str(value) for name, value in {**PATIENT, **settings}.items()},
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
        _, errors = await asyncio.wait_for(other.communicate(), PATIENCE_S)
        assert other.returncode is not None
        return other.returncode, errors.decode()

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
def limit_s() -> float:
    """Of what a test lets pass: what is to come within it does so on a busy machine too."""
    return LIMIT_S


@pytest.fixture
def until() -> Callable[..., Any]:
    """Poll with the scripted station's patience."""
    return scripted_station.until
