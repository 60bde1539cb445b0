"""A server on the wire, and a client that sends exactly the given bytes."""

import asyncio
import contextlib
import logging
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from typing import Any

import pytest

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.map import BY_NAME
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from plc_interface.server.server import ModbusServer
from plc_interface.server.write_lock import WriterChange
from station.settings.modbus import ModbusSettings

DEADLINE_S = 20.0


class Serving:
    """A server on an event loop in a thread of its own."""

    def __init__(self, **settings: Any) -> None:
        self.settings = ModbusSettings(**settings)
        self.writes: list[dict[str, Any]] = []
        self.changes: list[tuple[Peer | None, WriterChange]] = []
        self.image: RegisterImage
        self.server: ModbusServer
        self.loop = asyncio.new_event_loop()
        self.again: asyncio.Handle | None = None
        self._thread = threading.Thread(target=self.loop.run_forever, name="modbus server", daemon=True)

    def start(self) -> None:
        self._thread.start()
        try:
            asyncio.run_coroutine_threadsafe(self._start(), self.loop).result(DEADLINE_S)
        except BaseException:
            self._end()
            raise

    def stop_server(self) -> None:
        asyncio.run_coroutine_threadsafe(self.server.stop(), self.loop).result(DEADLINE_S)

    def stop(self) -> None:
        self.stop_server()
        self._end()

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Run something on the server's loop, as the process around it does."""
        result: Future[Any] = Future()

        def run() -> None:
            try:
                result.set_result(function(*arguments))
            except BaseException as error:  # noqa: BLE001
                result.set_exception(error)

        self.loop.call_soon_threadsafe(run)
        return result.result(DEADLINE_S)

    def wait(self, condition: Callable[[], Any]) -> Any:
        """The condition's value once it is true, checked on the loop."""
        return wait_for(lambda: self.call(condition))

    async def _start(self) -> None:
        self.image = RegisterImage(WordOrder(self.settings.word_order))
        self.server = ModbusServer(self.settings, self.image, self._on_write, self._on_writer)
        await self.server.start()

    def _on_write(self, peer: Peer, values: Mapping[str, Any]) -> None:
        self.writes.append(dict(values))

    def _on_writer(self, peer: Peer | None, change: WriterChange) -> None:
        self.changes.append((peer, change))

    def _end(self) -> None:
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(DEADLINE_S)
        self.loop.close()


class Wire:
    """One connection, byte by byte."""

    def __init__(self, port: int, host: str = "127.0.0.1", source: str = "127.0.0.1") -> None:
        self.socket = socket.create_connection((host, port), DEADLINE_S, (source, 0))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.transaction = 0

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def request(self, message: bytes, unit: int = 1) -> bytes:
        """A well-formed frame."""
        self.transaction = (self.transaction + 1) % 65_536
        return struct.pack(">HHHB", self.transaction, 0, len(message) + 1, unit) + message

    def receive(self) -> tuple[int, int, bytes]:
        """Transaction, unit and message of the next frame."""
        transaction, protocol, length, unit = struct.unpack(">HHHB", self._exactly(7))
        assert protocol == 0
        return transaction, unit, self._exactly(length - 1)

    def exchange(self, message: bytes, unit: int = 1) -> bytes:
        """Send one request and return its response."""
        self.send(self.request(message, unit))
        transaction, answering_unit, answer = self.receive()
        assert (transaction, answering_unit) == (self.transaction, unit)
        return answer

    def read(self, address: int, count: int, function: int = 3) -> bytes:
        answer = self.exchange(struct.pack(">BHH", function, address, count))
        assert answer[0] == function, answer.hex()
        assert answer[1] == len(answer) - 2
        return answer[2:]

    def write(self, address: int, *words: int) -> bytes:
        """The answer to function code 16."""
        count = len(words)
        return self.exchange(struct.pack(f">BHHB{count}H", 16, address, count, 2 * count, *words))

    def claim(self) -> None:
        """Set the write key, and so become the writer."""
        assert self.write(BY_NAME["write_key"].address, WRITE_KEY)[0] == 16

    def is_closed(self) -> bool:
        """Wait for the end of the connection; False where bytes come instead."""
        try:
            return self.socket.recv(1) == b""
        except ConnectionResetError:
            return True

    def reset(self) -> None:
        """End the connection with RST."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()

    def close(self) -> None:
        self.socket.close()

    def _exactly(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            assert part, f"the connection ended after {data.hex()}"
            data += part
        return data


def wait_for(condition: Callable[[], Any]) -> Any:
    """The condition's value once it is true."""
    pause = threading.Event()
    for _ in range(int(DEADLINE_S / 0.02)):
        if value := condition():
            return value
        pause.wait(0.02)
    pytest.fail("it did not come true in time")


@pytest.fixture
def serve(unused_port: int, caplog: pytest.LogCaptureFixture) -> Iterator[Callable[..., Serving]]:
    """Start servers; they are stopped after the test."""
    caplog.set_level(logging.INFO, "plc_interface")
    running: list[Serving] = []

    def start(**settings: Any) -> Serving:
        serving = Serving(**{"port": unused_port, **settings})
        serving.start()
        running.append(serving)
        return serving

    yield start
    for serving in running:
        serving.stop()


@pytest.fixture
def connect(serve: Callable[..., Serving]) -> Iterator[Callable[..., Wire]]:
    """Open connections; they are closed after the test."""
    wires: list[Wire] = []

    def open_(serving: Serving, source: str = "127.0.0.1", port: int | None = None) -> Wire:
        wires.append(Wire(port or serving.settings.port, source=source))
        return wires[-1]

    yield open_
    for wire in wires:
        wire.close()


@pytest.fixture
def crowd() -> Iterator[Callable[[int, int, str], list[socket.socket]]]:
    """Sockets that are closed after the test."""
    with contextlib.ExitStack() as stack:

        def come(port: int, count: int, source: str) -> list[socket.socket]:
            arrived: list[socket.socket] = []
            for _ in range(count):
                client = socket.socket()
                stack.enter_context(client)
                client.settimeout(20.0)
                client.bind((source, 0))
                client.setblocking(False)
                with contextlib.suppress(BlockingIOError):
                    client.connect(("127.0.0.1", port))
                arrived.append(client)
            return arrived

        yield come


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any]], Any]:
    """Wait for a condition."""
    return wait_for
