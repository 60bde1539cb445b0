"""Base of our HTTP servers: a guarded listening socket with a clear error, and signals left to the process."""

import contextlib
import errno
import gc
import socket
from collections.abc import Callable, Iterator
from typing import Any

import uvicorn
from starlette.types import ASGIApp

from station.errors import StationError
from station.memory import return_freed_memory
from station.serving.guard import ADMITTED_AT_ONCE, KEEP_ALIVE_S, GuardedListener, Limits, is_this_machines

CLOSE_S = 1.0
"""Maximum wait for pending answers when closing."""
FREED_EACH_TICKS = 10
"""Uvicorn ticks ten times a second."""


class AddressError(StationError):
    """An address that cannot be listened on."""


class Server(uvicorn.Server):
    """Server of one application on one listener. It leaves the process's signals to the process.

    Args:
        listener: guards its connections.
        options: of `uvicorn.Config`, in addition.
    """

    def __init__(self, listener: GuardedListener, app: ASGIApp, **options: Any) -> None:
        self._listener = listener
        config = uvicorn.Config(
            listener.guarded(app),
            log_config=None,
            access_log=False,
            ws="none",
            server_header=False,
            proxy_headers=False,
            backlog=ADMITTED_AT_ONCE,
            h11_max_incomplete_event_size=16 * 1024,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=CLOSE_S,  # pyrefly: ignore[bad-argument-type] (uvicorn's `int`: a part of a second is right too)
            **options,
        )
        super().__init__(config)

    async def run_until_exit(self) -> None:
        """Serve until `should_exit`."""
        await self.serve(sockets=[self._listener])

    async def on_tick(self, counter: int) -> bool:
        """Disconnect overdue clients ten times a second, and free what failed TLS handshakes leave once a second.

        The exception of such a handshake holds its connection in a reference cycle (CPython issue 109534). Its few
        objects would wait for the collector until there are thousands of them, each connection with 0.4 MB of buffers.
        """
        self._listener.sweep()
        if self.config.is_ssl and self._listener.ended_without_request and counter % FREED_EACH_TICKS == 0:
            self._listener.ended_without_request = False
            gc.collect()  # takes milliseconds: the objects of the start are frozen (`station.cli`)
            return_freed_memory()
        return await super().on_tick(counter)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listen(
    host: str, port: int, setting: str, what: str, limits: Limits, known: Callable[[str], bool] = is_this_machines
) -> GuardedListener:
    """Return a listening socket, or raise one clear sentence.

    Args:
        host: an address or a name of this machine.
        port: TCP; 0 takes a free one.
        setting: the configuration's section with `host` and `port`.
        what: the service, as `the pages`.
        known: returns whether an address may use the reserve.

    Raises:
        AddressError: the port is in use, or the address is not this machine's.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = GuardedListener(family, limits, known)
    except OSError as error:
        raise AddressError(f"{setting}.host {host!r}: {error.strerror}; set an address of this machine") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen()
        listener.settimeout(0)
    except OSError as error:
        listener.close()
        why = {
            errno.EADDRINUSE: f"another program listens there; stop it, or set another {setting}.port",
            errno.EADDRNOTAVAIL: (
                "that is no address of this machine, or not yet; as a service the station starts again until its "
                f"network is up; else set another {setting}.host"
            ),
            errno.EACCES: f"this user may not listen on so low a port; set {setting}.port to 1024 or more",
        }.get(error.errno or 0, f"{error.strerror}; set another {setting}.host or {setting}.port")
        raise AddressError(f"{what} cannot be served on {host}:{port}: {why}") from error
    return listener
