"""A channel whose connection carries nonsense once: the next requests are answered again."""

import asyncio
import contextlib
from collections.abc import Callable

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Noted, Resume
from station.channel.messages import ChannelError
from station.channel.server import ChannelServer

SWALLOWED = b"\x02" + (1_000_000).to_bytes(8, "big")
"""A long frame's head: ZMTP waits for a million bytes."""
RESERVED = b"\xff\xff"
"""Flags that ZMTP does not have."""


@pytest.mark.parametrize("spoilt", [SWALLOWED, RESERVED])
@pytest.mark.parametrize("towards", ["client", "server"])
def test_a_connection_that_was_spoilt_is_made_anew(
    spoilt: bytes, towards: str, unused_ports: Callable[[int], list[int]]
):
    async def scenario() -> None:
        behind, port = unused_ports(2)
        writers: list[tuple[asyncio.StreamWriter, asyncio.StreamWriter]] = []

        async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            with contextlib.closing(writer), contextlib.suppress(OSError):
                while data := await reader.read(4096):
                    writer.write(data)

        async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", behind)
            writers.append((writer, far_writer))
            await asyncio.gather(carry(reader, far_writer), carry(far_reader, writer))

        async def answer(_request: Resume) -> Noted:
            return Noted()

        serving = asyncio.create_task(ChannelServer(f"tcp://127.0.0.1:{behind}", {Resume: answer}).serve())
        relaying = await asyncio.start_server(relay, "127.0.0.1", port)
        async with ChannelClient(f"tcp://127.0.0.1:{port}", "the server") as client:
            await client.request(Resume(), Noted, deadline_s=20.0)
            writers[0][towards == "server"].write(spoilt)
            async with asyncio.timeout(30.0):
                while len(writers) < 2:
                    with contextlib.suppress(ChannelError):
                        await client.request(Resume(), Noted, deadline_s=0.3)
                    await asyncio.sleep(0.05)
            await client.request(Resume(), Noted, deadline_s=20.0)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        relaying.close()

    asyncio.run(scenario())
