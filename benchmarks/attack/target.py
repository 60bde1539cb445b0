"""The attacked station, the crowds of clients that come to it, and an attack's result."""

import contextlib
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import psutil

from .bystanders import HOST

STRANGER = "10.79.9.1"
STRANGERS = tuple(f"10.79.9.{number}" for number in range(1, 251))
CONNECT_S = 10.0


class Target(NamedTuple):
    """Attacked station: ports and URLs that an attacker reaches, and the places where the results are read."""

    modbus: int
    modbus_tls: int
    metrics: int
    pages: str
    tls: str
    """URL of pages over TLS."""
    home: Path
    token: str
    """An operator's API token."""
    processes: dict[str, psutil.Process]
    seconds: float
    """Duration of one attack."""

    def port_of(self, url: str) -> int:
        """Return a URL's port."""
        return int(url.rpartition(":")[2])


class Found(NamedTuple):
    """Result of an attack."""

    tries: int
    seen: str
    wrong: str = ""
    """Empty where all is as it has to be."""


class Attack(NamedTuple):
    """One attack."""

    on: str
    """The attacked process: plc, hmi, tls or service."""
    name: str
    run: Callable[[Target], Found]


@contextlib.contextmanager
def crowd(
    port: int, count: int, sources: tuple[str, ...], sent: bytes = b"", context: ssl.SSLContext | None = None
) -> Iterator[list[socket.socket]]:
    """Clients that connect in turn from these addresses, send something, and then nothing more."""
    with contextlib.ExitStack() as stack:
        clients: list[socket.socket] = []
        for number in range(count):
            with contextlib.suppress(OSError):  # refused, or put out again by now
                client = socket.create_connection((HOST, port), CONNECT_S, (sources[number % len(sources)], 0))
                stack.callback(client.close)
                clients.append(client)
                if context is not None:
                    client = context.wrap_socket(client, server_hostname=HOST)
                    stack.callback(client.close)
                    clients[-1] = client
                client.sendall(sent)
        yield clients


def still_open(clients: list[socket.socket]) -> int:
    """Return how many connections the station has not ended; what it sent is read."""
    return sum(not _ended(client) for client in clients)


def _ended(client: socket.socket) -> bool:
    client.settimeout(0.0)
    try:
        while client.recv(65_536):
            pass
    except (BlockingIOError, ssl.SSLWantReadError):
        return False
    except (OSError, ValueError):
        return True
    return True


def silent(
    port: int,
    count: int,
    sources: tuple[str, ...],
    seconds: float,
    sent: bytes = b"",
    context: ssl.SSLContext | None = None,
) -> Found:
    """Hold a crowd for some seconds."""
    with crowd(port, count, sources, sent, context) as clients:
        at_once = still_open(clients)
        time.sleep(seconds)
        return Found(count, f"{at_once} open at first, {still_open(clients)} after {seconds:g} s")
