"""Notifications to the supervisor: readiness and progress.

The protocol is the one of sd_notify(3), so the same process runs below systemd and below `station run`.
"""

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import AsyncIterator, Callable

SOCKET_VARIABLE = "NOTIFY_SOCKET"
WATCHDOG_VARIABLE = "WATCHDOG_USEC"
PARENT_VARIABLE = "SUPERVISOR_PID"
EXTEND = b"EXTEND_TIMEOUT_USEC="
_EXTENSION_S, _EXTENDED_EVERY_S, _EXTENDED_LONGEST_S = 60, 10.0, 3600.0
_FEEDS_PER_TIMEOUT = 4
_POLL_S = 0.5


def notify(message: str) -> None:
    """Send a message, as `READY=1`, `WATCHDOG=1`, `STOPPING=1` or `STATUS=…`, to the supervisor, if one listens."""
    address = os.environ.get(SOCKET_VARIABLE, "")
    if not address:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.settimeout(0.0)
        try:
            sender.sendto(message.encode(), "\0" + address[1:] if address.startswith("@") else address)
        except OSError:
            return


@contextlib.asynccontextmanager
async def extended_start() -> AsyncIterator[None]:
    """Extend the supervisor's limit on this process's start while the block runs, for an hour at most."""
    extending = asyncio.create_task(_extend_start(), name="start's extension")
    try:
        yield
    finally:
        extending.cancel()
        await asyncio.gather(extending, return_exceptions=True)


async def _extend_start() -> None:
    for _ in range(round(_EXTENDED_LONGEST_S / _EXTENDED_EVERY_S)):
        notify(f"{EXTEND.decode()}{_EXTENSION_S * 1_000_000}")
        await asyncio.sleep(_EXTENDED_EVERY_S)


async def feed_watchdog(progressing: Callable[[], bool]) -> None:
    """Feed the supervisor's watchdog as long as there is progress, and end this process when it is orphaned.

    Runs until cancelled, and checks progress several times in each time-out. A supervisor that was killed cannot end
    its processes, so they end themselves, by the same SIGTERM that it would have sent.
    """
    timeout_s = int(os.environ.get(WATCHDOG_VARIABLE, "0")) / 1e6
    parent = int(os.environ.get(PARENT_VARIABLE, "0"))
    pause_s = min(_POLL_S, timeout_s / _FEEDS_PER_TIMEOUT) if timeout_s else _POLL_S
    while True:
        if timeout_s and progressing():
            notify("WATCHDOG=1")
        if parent and os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGTERM)
            return
        await asyncio.sleep(pause_s)
