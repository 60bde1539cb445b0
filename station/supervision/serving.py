"""Base of our HTTP servers: a listening socket with a clear error, and signals left to the process."""

import contextlib
import errno
import socket
from collections.abc import Iterator

import uvicorn

from station.errors import StationError

CLOSE_S = 1.0
"""Maximum wait for pending answers when closing."""


class AddressError(StationError):
    """An address that cannot be listened on."""


class Server(uvicorn.Server):
    """A server that leaves the process's signals to the process."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listen(host: str, port: int, setting: str, what: str) -> socket.socket:
    """Return a listening socket, or raise one clear sentence.

    Args:
        host: an address or a name of this machine.
        port: TCP; 0 takes a free one.
        setting: the configuration's section with `host` and `port`.
        what: the service, as `the pages`.

    Raises:
        AddressError: the port is in use, or the address is not this machine's.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise AddressError(f"{setting}.host {host!r}: {error.strerror}; set an address of this machine") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(64)
        listener.settimeout(0)
    except OSError as error:
        listener.close()
        why = {
            errno.EADDRINUSE: f"another program listens there; stop it, or set another {setting}.port",
            errno.EADDRNOTAVAIL: f"that is no address of this machine; set another {setting}.host",
            errno.EACCES: f"this user may not listen on so low a port; set {setting}.port to 1024 or more",
        }.get(error.errno or 0, f"{error.strerror}; set another {setting}.host or {setting}.port")
        raise AddressError(f"{what} cannot be served on {host}:{port}: {why}") from error
    return listener
