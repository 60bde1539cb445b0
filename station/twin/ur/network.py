"""The controller's ports: who is connected, and the line and stream protocols beside RTDE."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

from station.twin.faults import CommonFault
from station.twin.ports import stop_listening
from station.twin.ur import dashboard, primary, rtde

if TYPE_CHECKING:  # the controller makes these itself
    from station.twin.ur.controller import UrController

SCRIPT_PORT = 30003
LONGEST_LINE = 32768
LONGEST_SCRIPT = 1_000_000
GARBAGE_LINE = b"\xff\x00\x13 garbage\n"


class Network:
    """The servers of one controller; they open, cut and close together."""

    def __init__(self, controller: "UrController") -> None:
        self._controller = controller
        self._servers: list[asyncio.Server] = []
        self._streams: dict[asyncio.Task[None], asyncio.StreamWriter] = {}
        self._programmers: set[asyncio.StreamWriter] = set()
        self.connections: set[rtde.RtdeConnection] = set()

    async def open(self) -> None:
        """Listen on every port.

        Raises:
            OSError: one of them is taken; none is then listened on.
        """
        host = self._controller.host
        try:
            self._servers.append(
                await asyncio.get_running_loop().create_server(
                    lambda: rtde.RtdeConnection(self._controller, self.connections), host, rtde.PORT
                )
            )
            for port, serve in (
                (dashboard.PORT, self._serve_dashboard),
                (SCRIPT_PORT, self._serve_script),
                (primary.PORT, self._serve_primary),
            ):
                self._servers.append(await asyncio.start_server(serve, host, port, limit=LONGEST_LINE))
        except OSError:
            await self.close()
            raise

    async def close(self) -> None:
        """Refuse and cut every connection; closing twice does nothing."""
        servers, self._servers = self._servers, []
        for server in servers:
            await stop_listening(server)
        streams = list(self._streams)
        for stream in streams:
            stream.cancel()
        connections = list(self.connections)
        self.cut()
        await asyncio.gather(*streams, *(connection.lost for connection in connections), return_exceptions=True)
        for server in servers:
            await server.wait_closed()

    def cut(self) -> None:
        """Cut every connection, as a pulled cable does; new ones are taken."""
        for connection in list(self.connections):
            connection.cut()
        for writer in self._streams.values():
            writer.transport.abort()

    def cut_programmers(self) -> None:
        """Cut those connections that programs come over."""
        for writer in self._programmers:
            writer.transport.abort()

    async def _serve_dashboard(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with self._stream(writer):
            await self._say(writer, dashboard.BANNER.encode() + b"\n")
            while line := await reader.readline():
                text = line.decode("ascii", "replace")
                answer = self._controller.answer(text).encode() + b"\n"
                await self._say(writer, GARBAGE_LINE if self._active(CommonFault.GARBAGE) else answer)
                if text.strip().lower() in {"quit", "shutdown"}:
                    return

    async def _serve_script(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with self._stream(writer, programs=True):
            await self._take_programs(reader)

    async def _serve_primary(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with self._stream(writer, programs=True), asyncio.TaskGroup() as group:
            taking = group.create_task(self._take_programs(reader))
            await self._say(writer, primary.version_message(self._controller))
            while not taking.done():
                await self._say(writer, primary.robot_mode_message(self._controller))
                # A pause that ends at once when the client has gone.
                await asyncio.wait({taking}, timeout=primary.PERIOD_S)

    async def _take_programs(self, reader: asyncio.StreamReader) -> None:
        """Wait for programs; ur-rtde's control script is recognised by the names that it uses, at its last line."""
        text = bytearray()
        while part := await reader.read(65536):
            text += part
            if text.endswith(b"\nend\n"):
                if b"process_cmd(" in text and b"read_input_integer_reg" in text:
                    self._controller.script.upload(self._controller.clock.now_s())
                text.clear()
            if len(text) > LONGEST_SCRIPT:
                return

    @contextlib.asynccontextmanager
    async def _stream(self, writer: asyncio.StreamWriter, *, programs: bool = False) -> AsyncIterator[None]:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 (a coroutine always runs in one)
        self._streams[task] = writer
        if programs:
            self._programmers.add(writer)
        try:
            yield
        except* (OSError, ValueError, asyncio.CancelledError):
            # A peer that goes, or a line without an end, ends its own connection only. Only `close` cancels, and
            # asyncio would report the cancelled task of a connection as an error.
            pass
        finally:
            self._streams.pop(task)
            self._programmers.discard(writer)
            writer.transport.abort()

    async def _say(self, writer: asyncio.StreamWriter, data: bytes) -> None:
        if self._active("silent"):
            return
        await asyncio.sleep(self._controller.faults.amount(CommonFault.DELAYED))
        writer.write(data)
        await writer.drain()

    def _active(self, fault: str) -> bool:
        return self._controller.faults.active(fault)
