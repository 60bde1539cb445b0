"""TLS handshakes under way: each has a place, within the limits, before a byte of it is read."""

import asyncio
import contextlib
import socket
import ssl
from typing import cast

from plc_interface.server.connection import Connection
from plc_interface.server.connection_manager import ConnectionManager


class TlsHandshakes(asyncio.Protocol):
    """Protocol of all clients of the TLS port until their handshakes are done.

    A listener with `ssl=` reports a client only after its handshake: silent ones would be counted nowhere.
    """

    def __init__(self, manager: ConnectionManager, context: ssl.SSLContext, deadline_s: float) -> None:
        self._manager, self._context, self._deadline_s = manager, context, deadline_s
        self._under_way: dict[asyncio.Task[None], asyncio.Transport] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin a client's handshake, or close the connection."""
        plain = cast("asyncio.Transport", transport)
        connection = Connection(self._manager)
        if not self._manager.enter(connection, plain):
            plain.abort()
            return
        plain.pause_reading()  # the handshake reads
        task = asyncio.create_task(self._shake_hands(plain, connection), name="TLS handshake")
        self._under_way[task] = plain
        task.add_done_callback(self._under_way.pop)

    async def close(self) -> None:
        """End the handshakes under way. Idempotent."""
        for plain in self._under_way.values():
            # Shutting down ends the handshake on the duplicate as well; closing this descriptor would not.
            with contextlib.suppress(OSError):  # the client has gone already
                plain.get_extra_info("socket").shutdown(socket.SHUT_RDWR)
        await asyncio.gather(*self._under_way)

    async def _shake_hands(self, plain: asyncio.Transport, connection: Connection) -> None:
        why = ""
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: connection,
                # A socket of its own: the plain transport closes the other one at the end.
                plain.get_extra_info("socket").dup(),
                ssl=self._context,
                ssl_handshake_timeout=self._deadline_s,
                ssl_shutdown_timeout=self._deadline_s,
            )
        except Exception as error:  # noqa: BLE001 (whatever a client sends, its place is to be free again)
            why = str(error) or "the client has ended it"
            error.__traceback__ = None  # holds the connection's buffers, 0.3 MB, in a cycle (CPython issue 109534)
        finally:
            self._manager.leave(connection, why)
            plain.abort()
