"""Connection that receives into given memory: an end in the middle, and a peer that takes nothing."""

import asyncio

import pytest

from station.devices.camera.connection import connect


def test_an_end_in_the_middle_is_an_error_and_so_is_what_is_asked_for_after_it():
    async def run() -> None:
        async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(b"abcdefg")
            writer.close()

        async with await asyncio.start_server(serve, "127.0.0.1", 0) as server, asyncio.timeout(10):
            connection = await connect(*server.sockets[0].getsockname())
            assert await connection.read(3) == b"abc"
            for _ in range(2):
                with pytest.raises(EOFError):
                    await connection.fill(memoryview(bytearray(5)))
            await connection.close()

    asyncio.run(run())


def test_a_peer_that_takes_nothing_does_not_hold_up_the_end():
    async def run() -> None:
        ended = asyncio.Event()

        async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await ended.wait()
            writer.transport.abort()

        async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
            connection = await connect(*server.sockets[0].getsockname())
            connection.write(bytes(50_000_000))
            try:
                async with asyncio.timeout(10):
                    await connection.close()
            finally:
                ended.set()

    asyncio.run(run())
