"""A channel whose connection carries nonsense, or nothing, once: the next requests are answered again."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Noted, Resume
from station.channel.messages import ChannelError
from station.channel.server import ChannelServer

SWALLOWED = b"\x02" + (1_000_000).to_bytes(8, "big")
"""A long frame's head: ZMTP waits for a million bytes."""
RESERVED = b"\xff\xff"
"""Flags that ZMTP does not have."""


Streams = tuple[asyncio.StreamWriter, asyncio.StreamWriter]


def between(
    ports: list[int], body: Callable[[ChannelClient, list[Streams]], Awaitable[None]], *, silent_at_first: bool = False
) -> None:
    """Run a body with a client of a server behind a relay, and the relay's connections as both sides' streams.

    Args:
        ports: of the server and of the relay.
        body: gets the client, and the streams to it and to the server of each connection in turn.
        silent_at_first: the first connection is taken, and nothing of it passes.
    """
    behind, port = ports
    connections: list[Streams] = []

    async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.closing(writer), contextlib.suppress(OSError):
            while data := await reader.read(4096):
                writer.write(data)

    async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        first = not connections
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", behind)
        connections.append((writer, far_writer))
        if first and silent_at_first:
            with contextlib.closing(writer), contextlib.closing(far_writer):
                await reader.read()
        else:
            await asyncio.gather(carry(reader, far_writer), carry(far_reader, writer))

    async def answer(_request: Resume) -> Noted:
        return Noted()

    async def scenario() -> None:
        serving = asyncio.create_task(ChannelServer(f"tcp://127.0.0.1:{behind}", {Resume: answer}).serve())
        relaying = await asyncio.start_server(relay, "127.0.0.1", port)
        async with ChannelClient(f"tcp://127.0.0.1:{port}", "the server") as client:
            await body(client, connections)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        relaying.close()

    asyncio.run(scenario())


@pytest.mark.parametrize("spoilt", [SWALLOWED, RESERVED])
@pytest.mark.parametrize("towards", ["client", "server"])
def test_a_connection_that_was_spoilt_is_made_anew(
    spoilt: bytes, towards: str, unused_ports: Callable[[int], list[int]]
):
    async def body(client: ChannelClient, connections: list[Streams]) -> None:
        await client.request(Resume(), Noted, deadline_s=20.0)
        connections[0][towards == "server"].write(spoilt)
        async with asyncio.timeout(30.0):
            while len(connections) < 2:
                with contextlib.suppress(ChannelError):
                    await client.request(Resume(), Noted, deadline_s=0.3)
                await asyncio.sleep(0.05)
        await client.request(Resume(), Noted, deadline_s=20.0)

    between(unused_ports(2), body)


def test_a_connection_whose_greeting_was_lost_is_made_anew(unused_ports: Callable[[int], list[int]]):
    """ZeroMQ pings only who has greeted, and would wait for the greeting for half a minute."""

    async def body(client: ChannelClient, connections: list[Streams]) -> None:
        await client.request(Resume(), Noted, deadline_s=20.0)
        assert len(connections) > 1

    between(unused_ports(2), body, silent_at_first=True)
