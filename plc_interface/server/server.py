"""The Modbus TCP server."""

import asyncio
import errno
import socket
from collections.abc import Callable
from functools import partial

from plc_interface.server.connection import Connection
from plc_interface.server.connection_manager import ConnectionManager
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from plc_interface.server.request_handler import OnWrite
from plc_interface.server.statistics import Statistics
from plc_interface.server.tls import server_context
from plc_interface.server.tls_handshakes import TlsHandshakes
from plc_interface.server.write_lock import OnWriter
from station.errors import StationError
from station.settings.modbus import ModbusSettings

BACKLOG = 128
"""Connections that wait in the kernel to be taken."""

UNTAKEN_BYTES = 64 * 1024
"""Send buffer of one connection, bytes: small, so that a client that does not read is noticed soon and many connections
take little memory. An estimate."""


class ModbusServerError(StationError):
    """The server cannot be started."""


class ModbusServer:
    """Serves a register image to the line's PLC, and with TLS on a second port."""

    def __init__(self, settings: ModbusSettings, image: RegisterImage, on_write: OnWrite, on_writer: OnWriter) -> None:
        """Nothing is served before `start`. Made, started and stopped on one event loop.

        Args:
            image: the registers; commit to it on this event loop alone.
            on_write: called with whole fields, after every check and before they are in the image. It runs
                between request and response and must not wait.
            on_writer: called when the right to write is granted or withdrawn.
        """
        self._settings = settings
        self._manager = ConnectionManager(settings, image, on_write, on_writer)
        self._listeners: list[asyncio.Server] = []
        self._handshakes: TlsHandshakes | None = None

    @property
    def statistics(self) -> Statistics:
        """Counters since the server was made."""
        return self._manager.statistics

    @property
    def connections(self) -> int:
        """Number of connected clients."""
        return self._manager.connections

    @property
    def writer(self) -> Peer | None:
        """The client with the right to write, if any."""
        return self._manager.write_lock.holder

    async def start(self) -> None:
        """Listen on the port, and on the second one where TLS is enabled.

        Raises:
            StationError: a port in use or without the right to it, an address that is not ours, a bad certificate.
        """
        settings, tls = self._settings, self._settings.tls
        if tls.enabled:
            self._handshakes = TlsHandshakes(self._manager, server_context(tls), settings.frame_timeout_s)
        await self._listen("modbus", settings.port, partial(Connection, self._manager))
        try:
            if (handshakes := self._handshakes) is not None:
                await self._listen("modbus.tls", tls.port, lambda: handshakes)
        except StationError:
            await self.stop()
            raise
        self._manager.open()

    async def stop(self) -> None:
        """Close the ports and every connection. Idempotent."""
        for listener in self._listeners:
            listener.close()
        self._listeners.clear()
        self._manager.close()
        if self._handshakes is not None:
            await self._handshakes.close()
        # A plain transport closes its socket in the loop's next turn.
        await asyncio.sleep(0)

    async def _listen(self, section: str, port: int, protocol: Callable[[], asyncio.BaseProtocol]) -> None:
        host = self._settings.host
        try:
            listener = await asyncio.get_running_loop().create_server(protocol, host, port, backlog=BACKLOG)
        except OSError as error:
            raise ModbusServerError(why_not(section, host, port, error)) from error
        for listening in listener.sockets:  # who is accepted inherits it
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNTAKEN_BYTES)
        self._listeners.append(listener)


def why_not(section: str, host: str, port: int, error: OSError) -> str:
    """Describe why a port cannot be served, and what to do."""
    place = f"Modbus TCP cannot be served on {host}, port {port}"
    if error.errno == errno.EADDRINUSE:
        return f"{place}: another program listens there: stop it (ss -ltnp names it), or set {section}.port"
    if error.errno == errno.EACCES:
        return (
            f"{place}: ports below 1024 need a right: give the service CAP_NET_BIND_SERVICE (systemd: "
            f"AmbientCapabilities=), or set {section}.port"
        )
    if error.errno == errno.EADDRNOTAVAIL or isinstance(error, socket.gaierror):
        return (
            f"{place}: this machine has no such address, or not yet: as a service the station starts again until its "
            "network is up; else set modbus.host to one that `ip address` shows"
        )
    return f"{place}: {error.strerror or error}: set modbus.host and {section}.port to where it can be"
