"""The proxy that disturbs links, and the laws that are checked behind it."""

import asyncio
import random
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing

import pytest

from benchmarks.reliability.link_story import Moment, draw
from benchmarks.reliability.proxy import Disturbance, Kind, Link, Route, Way, corrupted, split

PROXY, BEHIND = "127.0.0.91", "127.0.0.92"


@asynccontextmanager
async def echoed() -> AsyncIterator[tuple[Link, asyncio.StreamReader, asyncio.StreamWriter]]:
    """A link to a server that gives everything back, and a connection through it."""

    async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with closing(writer):
            while data := await reader.read(1000):
                writer.write(data)

    server = await asyncio.start_server(echo, BEHIND, 0)
    port = server.sockets[0].getsockname()[1]
    link = Link(PROXY, (Route(BEHIND, port),))
    await link.open()
    reader, writer = await asyncio.open_connection(PROXY, port)
    try:
        yield link, reader, writer
    finally:
        writer.close()
        await link.close()
        server.close()
        await server.wait_closed()


def disturbed(kind: Kind, lasts_s: float, sent: bytes) -> tuple[bytes, Disturbance]:
    """Return what comes back of some bytes, up to the connection's end or a second of silence, and the disturbance."""
    return asyncio.run(_disturbed(kind, lasts_s, sent))


async def _disturbed(kind: Kind, lasts_s: float, sent: bytes) -> tuple[bytes, Disturbance]:
    back = b""
    async with echoed() as (link, reader, writer):
        writer.write(b"before")
        assert await reader.readexactly(6) == b"before"
        disturbance = Disturbance(kind, Way.TO_STATION, lasts_s, random.Random(1))
        disturbing = asyncio.create_task(link.disturb(disturbance))
        await asyncio.sleep(0)
        writer.write(sent)
        try:
            async with asyncio.timeout(1.0):
                while data := await reader.read(1000):
                    back += data
                back += b"<FIN>"
        except TimeoutError:
            pass
        except ConnectionResetError:
            back += b"<RST>"
        await disturbing
    return back, disturbance


@pytest.mark.parametrize("kind", [Kind.DELAY, Kind.STALL, Kind.SPLIT])
def test_nothing_is_lost_or_changed_where_bytes_come_late_or_small(kind: Kind):
    back, disturbance = disturbed(kind, 0.3, b"0123456789")
    assert back == b"0123456789"
    assert disturbance.touched == 1


def test_a_segment_is_repeated():
    assert disturbed(Kind.REPEAT, 0.3, b"0123")[0] == b"01230123"


def test_a_corrupt_segment_differs():
    back, disturbance = disturbed(Kind.CORRUPT, 0.3, b"0123456789")
    assert back != b"0123456789"
    assert disturbance.touched == 1


def test_a_truncated_segment_ends_by_a_reset():
    assert disturbed(Kind.TRUNCATE, 0.3, b"0123456789")[0] == b"01234<RST>"


@pytest.mark.parametrize(("kind", "end"), [(Kind.CUT_FIN, b"<FIN>"), (Kind.CUT_RST, b"<RST>")])
def test_a_cut_ends_the_connection_in_its_way_and_refuses_others_for_a_while(kind: Kind, end: bytes):
    async def scenario() -> None:
        async with echoed() as (link, reader, writer):
            port = writer.get_extra_info("peername")[1]
            writer.write(b"x")
            assert await reader.readexactly(1) == b"x"
            disturbance = Disturbance(kind, Way.TO_STATION, 0.5, random.Random(1))
            disturbing = asyncio.create_task(link.disturb(disturbance))
            try:
                seen = await reader.read(1) or b"<FIN>"
            except ConnectionResetError:
                seen = b"<RST>"
            assert seen == end
            refused, other = await asyncio.open_connection(PROXY, port)
            with pytest.raises(ConnectionResetError):
                await refused.readexactly(1)
            other.close()
            await disturbing
            again, third = await asyncio.open_connection(PROXY, port)
            third.write(b"x")
            assert await again.readexactly(1) == b"x"
            third.close()

    asyncio.run(scenario())


def test_nobody_behind_the_proxy_is_a_reset():
    async def scenario() -> None:
        with socket.create_server((BEHIND, 0)) as taken:
            port = taken.getsockname()[1]
        link = Link(PROXY, (Route(BEHIND, port),))
        await link.open()
        reader, writer = await asyncio.open_connection(PROXY, port)
        with pytest.raises(ConnectionResetError):
            await reader.readexactly(1)
        writer.close()
        await link.close()

    asyncio.run(scenario())


def test_splitting_keeps_the_bytes_and_corrupting_does_not():
    chance, data = random.Random(3), random.Random(4).randbytes(5000)
    pieces = split(data, chance)
    assert b"".join(pieces) == data
    assert {len(piece) for piece in pieces[:256]} == {1}
    assert all(corrupted(data[: each + 1], chance) != data[: each + 1] for each in range(200))


def test_a_story_is_its_seed_and_has_every_moment():
    assert draw(5) == draw(5) != draw(6)
    moments = {plan.disturbance.moment for seed in range(5) for plan in draw(seed) if plan.disturbance}
    assert moments == set(Moment)
    assert all(plan == (False, None) for plan in draw(5)[-2:])
