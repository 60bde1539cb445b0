"""Closing of the ports that the twin's devices listen on."""

import asyncio

_TURNS_TO_A_SESSION = 4
"""Turns of asyncio's loop from an accepted connection to the first step of the task that serves it."""


async def stop_listening(server: asyncio.Server) -> None:
    """Close a server's sockets; every connection that it has accepted is then with the task that serves it.

    `Server.close` by itself leaves those that are still being made: in Python 3.11 they are either served by a server
    that is closed, or lost without being closed.
    """
    loop = asyncio.get_running_loop()
    for listening in server.sockets:
        loop.remove_reader(listening.fileno())
    try:
        for _ in range(_TURNS_TO_A_SESSION):
            await asyncio.sleep(0)
    finally:
        server.close()
