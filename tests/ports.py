"""Loopback ports for what a test starts."""

import contextlib
import itertools
import os
import secrets
import socket
from collections.abc import Iterator

_WORKERS = max(16, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) + 4)
"""With room for some that replace a crashed one: their numbers go on."""
_FIRST, _PORTS = 10_000, 22_400 // _WORKERS
"""Below the ports of outgoing connections (on Linux from 32,768), any of which may take a port before it is bound."""


def _own_ports() -> Iterator[int]:
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % _WORKERS
    first, begin = _FIRST + worker * _PORTS, secrets.randbelow(_PORTS)
    return itertools.cycle([first + (begin + place) % _PORTS for place in range(_PORTS)])


_ports = _own_ports()


def free_ports(count: int) -> list[int]:
    """Return different free ports; no other worker gets them, nor this one before hundreds of others."""
    found: list[int] = []
    while len(found) < count:
        port = next(_ports)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            found.append(port)
    return found


def free_port() -> int:
    """Return a free port, as `free_ports`."""
    return free_ports(1)[0]
