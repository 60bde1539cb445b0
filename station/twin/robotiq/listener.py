"""TCP listener of the twin's gripper: its port is closed while a fault makes the gripper unreachable."""

import asyncio
from abc import ABC, abstractmethod
from contextlib import suppress

from station.twin.faults import CommonFault, FaultBoard
from station.twin.ports import stop_listening
from station.twin.robotiq.model import RobotiqGripper

GARBAGE = bytes.fromhex("ff00a55a0df3c3e1fe0a")
"""What `garbage` answers: neither text nor a frame with a right CRC."""
_WATCH_S = 0.02
_LATEST_S = 60.0


async def disturbed(answer: bytes, faults: FaultBoard) -> bytes:
    """An answer as the faults `delayed` and `garbage` leave it."""
    await asyncio.sleep(min(_LATEST_S, max(0.0, faults.amount(CommonFault.DELAYED))))
    return GARBAGE if faults.active(CommonFault.GARBAGE) else answer


class Listener(ABC):
    """Listens on one address, runs a session for each connection, and is not there while the gripper is gone."""

    def __init__(self, gripper: RobotiqGripper, host: str = "127.0.0.1", port: int = 0) -> None:
        self.host = host
        self.port = port
        """The port listened on; where 0 was given, the one that was found at `start`."""
        self._gripper = gripper
        self._server: asyncio.Server | None = None
        self._watcher: asyncio.Task[None] | None = None
        self._sessions: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    async def start(self) -> None:
        """Listen.

        Raises:
            OSError: the address cannot be had.
        """
        await self._open()
        self._watcher = asyncio.create_task(self._watch(), name=f"twin gripper watch {self.port}")

    async def stop(self) -> None:
        """Close the port and every connection."""
        if self._watcher:
            self._watcher.cancel()
            with suppress(asyncio.CancelledError):
                await self._watcher
            self._watcher = None
        await self._close()

    @abstractmethod
    async def _session(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one client."""

    async def _watch(self) -> None:
        while True:
            away = self._gripper.faults.gone(self._gripper.clock.now_s())
            if away and self._server:
                await self._close()
            elif not away and not self._server:
                with suppress(OSError):
                    await self._open()
            await asyncio.sleep(_WATCH_S)

    async def _open(self) -> None:
        self._server = await asyncio.start_server(self._accept, self.host, self.port)
        # A port found for 0 stays the same one after a fault: the clients have its number.
        self.port = self._server.sockets[0].getsockname()[1]

    async def _close(self) -> None:
        if self._server:
            server, self._server = self._server, None
            await stop_listening(server)
        sessions = list(self._sessions.items())
        for task, writer in sessions:
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*(task for task, _ in sessions), return_exceptions=True)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(self._serve(reader, writer), name=f"twin gripper session {self.port}")
        self._sessions[task] = writer
        task.add_done_callback(self._sessions.pop)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            with suppress(OSError):
                await self._session(reader, writer)
        finally:
            writer.close()
