"""Connection guard of our HTTP servers: limits, and time limits, of connections, below TLS and HTTP."""

import asyncio
import contextlib
import ipaddress
import logging
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from station.serving.places import Places

FIRST_REQUEST_S = 10.0
"""From the connection's begin, TLS handshake included, to the end of its first request, body included."""
KEEP_ALIVE_S = 30
"""From a response to the next request."""
NEXT_REQUEST_S = KEEP_ALIVE_S + 5.0
"""Likewise, to that request's end."""
STALLED_S = 10.0
"""A client that does not take its response for so long is disconnected."""
WAITING = 128
"""Length of the kernel's queue of connections that are not accepted yet."""
ADMITTED_AT_ONCE = 1
"""Connections accepted in one turn of the event loop. A request is known here some five turns after its connection;
with more at once, a client's new connections could displace the one whose request is on its way."""
_TCP_INFO_BYTES_RECEIVED = slice(128, 136)
"""In tcp_info of linux/tcp.h."""

log = logging.getLogger(__name__)


class Limits(NamedTuple):
    """Numbers of connections."""

    most: int
    """Of all strangers together."""
    per_address: int
    reserve: int
    """Of all known addresses together."""


def is_this_machines(address: str) -> bool:
    """Return whether an address is this machine's own: a browser here comes from the one that it opens."""
    try:
        plain = ipaddress.ip_address(address.removeprefix("::ffff:"))
    except ValueError:
        return False
    if plain.is_loopback:
        return True
    if plain.is_unspecified or plain.is_multicast:
        return False
    try:
        with socket.socket(socket.AF_INET if plain.version == 4 else socket.AF_INET6) as probe:
            probe.bind((str(plain), 0))  # the kernel binds to no other machine's
    except OSError:  # also where no file descriptor is left: then who asks counts as a stranger
        return False
    return True


class GuardedConnection(socket.socket):
    """One client's connection. It has its place until it is closed and its last request is answered."""

    def __init__(self, accepted: socket.socket, client: tuple[str, int], listener: "GuardedListener") -> None:
        super().__init__(accepted.family, accepted.type, accepted.proto, accepted.detach())
        self._listener = listener
        self.client = client
        self.holder, self.known = client[0], False
        self.since_s = time.monotonic()
        """When it began, or its last response ended."""
        self.has_requested = self.in_request = self._is_closed = False

    @property
    def rank(self) -> tuple[float, ...] | None:
        """A silent one gives way first, then one without a whole request; one with a request under way does not."""
        if self.in_request:
            return None
        return (2 if self.has_requested else 1 if self._has_sent else 0, self.since_s)

    @property
    def _has_sent(self) -> bool:
        """True if any byte has come, read or not; False once the connection is closed."""
        try:
            info = self.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO_BYTES_RECEIVED.stop)
        except OSError:
            return False  # closed
        return any(info[_TCP_INFO_BYTES_RECEIVED])

    @property
    def overdue(self) -> bool:
        """True if the next request should have come by now."""
        limit_s = NEXT_REQUEST_S if self.has_requested else FIRST_REQUEST_S
        return not self.in_request and time.monotonic() - self.since_s > limit_s

    def displace(self) -> None:
        """End the connection: the event loop that reads it finds its end, and closes it."""
        with contextlib.suppress(OSError):
            self.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close it, and free its place."""
        super().close()
        if not self._is_closed and not self.has_requested:
            self._listener.ended_without_request = True
        self._is_closed = True
        self._leave()

    def begin(self) -> None:
        """Note that a whole request has come."""
        self.has_requested = self.in_request = True

    def end(self) -> None:
        """Note that a request is answered."""
        self.in_request, self.since_s = False, time.monotonic()
        self._leave()

    def _leave(self) -> None:
        if self._is_closed and not self.in_request:
            self._listener.places.leave(self)


class GuardedListener(socket.socket):
    """Listening socket that admits connections within limits; what it hands out has a place.

    Args:
        known: returns whether an address may use the reserve.
    """

    def __init__(self, family: int, limits: Limits, known: Callable[[str], bool]) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self._known = known
        self.places: Places[GuardedConnection] = Places(limits.most, limits.per_address, limits.reserve)
        self._flood = ""
        self.ended_without_request = False
        """Whether a connection was closed without a request, since this was last set back."""

    @property
    def flooded_by(self) -> str:
        """The address that floods this listener; empty for none."""
        return self.places.flooded_by

    def listen(self, backlog: int = WAITING) -> None:
        """Listen; the kernel's queue is ours to choose, an event loop passes how many it accepts at once."""
        del backlog
        super().listen(WAITING)

    def accept(self) -> tuple[socket.socket, Any]:
        """Return the next connection that has got a place; others are closed.

        Raises:
            BlockingIOError: there is none, or others have to have their turn.
        """
        for _ in range(WAITING):
            accepted, peer = super().accept()
            connection = GuardedConnection(accepted, (peer[0], peer[1]), self)
            connection.known = self._known(connection.holder)
            if self.places.enter(connection):
                return connection, peer
            connection.close()
        raise BlockingIOError

    def sweep(self) -> None:
        """Disconnect clients whose request does not come; to be called every now and then."""
        for connection in self.places:
            if connection.overdue:
                self.places.leave(connection)
                connection.displace()
        if self.flooded_by != self._flood:
            self._flood = self.flooded_by
            text = f"connections of {self._flood} are turned away" if self._flood else "no connections are turned away"
            log.warning("port %d: %s", self.getsockname()[1], text)

    def guarded(self, app: ASGIApp) -> ASGIApp:
        """Return an application that reports its requests here. It disconnects clients that do not take a response."""

        async def serve(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] != "http":
                await app(scope, receive, send)
                return
            client = tuple(scope["client"] or ())
            found = next((each for each in self.places if each.client == client), None)
            if found is None:  # displaced, or overdue, while its request came
                await PlainTextResponse("too many connections", 503, {"connection": "close"})(scope, receive, send)
                return

            connection = found  # never None, also in the functions below
            connection.known = self._known(connection.holder)
            if not _has_body(scope):
                connection.begin()

            async def receive_to_end() -> Message:
                message = await receive()
                if not message.get("more_body"):
                    connection.begin()
                return message

            async def send_in_time(message: Message) -> None:
                try:
                    async with asyncio.timeout(STALLED_S):
                        await send(message)
                except TimeoutError:
                    connection.displace()

            try:
                await app(scope, receive_to_end, send_in_time)
            finally:
                connection.end()

        return serve


def _has_body(scope: Scope) -> bool:
    headers = Headers(scope=scope)
    return "transfer-encoding" in headers or headers.get("content-length", "0") != "0"
