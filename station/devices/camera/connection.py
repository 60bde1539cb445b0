"""Connection that receives into given memory: a stream copies each byte of a frame several times."""

import asyncio
from typing import cast


class Connection(asyncio.BufferedProtocol):
    """A client's TCP connection, from `connect`. It reads from the network only what its caller requests."""

    def __init__(self) -> None:
        loop = asyncio.get_running_loop()
        self._lost: asyncio.Future[Exception] = loop.create_future()
        self._filled: asyncio.Future[None] = loop.create_future()
        self._rest = memoryview(b"")

    async def fill(self, memory: memoryview) -> None:
        """Receive as many bytes as the memory has. After a cancellation, only `close` is of use.

        Args:
            memory: contiguous, writable, of format `B`, not empty.

        Raises:
            EOFError: the other end has closed it before.
            OSError: it broke.
        """
        if self._lost.done():
            raise self._lost.result()
        self._rest, self._filled = memory, asyncio.get_running_loop().create_future()
        self._transport.resume_reading()
        await self._filled

    async def read(self, count: int) -> bytes:
        """Receive so many bytes; raise what `fill` raises."""
        if not count:
            return b""
        memory = bytearray(count)
        await self.fill(memoryview(memory))
        return bytes(memory)

    def write(self, data: bytes) -> None:
        """Send."""
        self._transport.write(data)

    async def close(self) -> None:
        """Close it, at once: what is not sent by then is dropped. Idempotent."""
        self._transport.abort()  # `close` would wait for a peer that takes nothing
        await asyncio.wait((self._lost,))  # which a cancellation of this wait leaves alone

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See `asyncio.BufferedProtocol`, as for all below."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.pause_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        """Make a waiting `fill` raise."""
        self._lost.set_result(exc or EOFError())
        if not self._filled.done():
            self._filled.set_exception(self._lost.result())
            self._filled.exception()  # nobody may wait for it

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return the memory still to be filled."""
        del sizehint
        return self._rest

    def buffer_updated(self, nbytes: int) -> None:
        """Count what has come; once that is all, take nothing more."""
        self._rest = self._rest[nbytes:]
        if not self._rest:
            self._transport.pause_reading()
            if not self._filled.done():  # else it was cancelled
                self._filled.set_result(None)


async def connect(host: str, port: int) -> Connection:
    """Connect.

    Raises:
        OSError: nothing answers there.
    """
    _, connection = await asyncio.get_running_loop().create_connection(Connection, host, port)
    return connection
