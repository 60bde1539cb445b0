"""The guard of our HTTP servers, tested over sockets, with short time limits."""

import asyncio
import contextlib
import errno
import socket
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from station.serving.guard import Limits, is_this_machines
from station.serving.server import Server, listen
from tests.eventually import until

REQUEST = b"GET / HTTP/1.1\r\nhost: here\r\n\r\n"
LARGE = b"GET /large HTTP/1.1\r\nhost: here\r\n\r\n"
ENDLESS = b"GET /endless HTTP/1.1\r\nhost: here\r\n\r\n"
LONG = b"GET /long HTTP/1.1\r\nhost: here\r\n\r\n"
LIMITS = Limits(most=8, per_address=4, reserve=4)
AS_PAGES = Limits(most=200, per_address=48, reserve=200)
LIMIT_S = 20.0
STRANGER, ANOTHER, KNOWN = "127.0.0.9", "127.0.0.8", "127.0.0.1"


@pytest.fixture(autouse=True)
def short_limits(monkeypatch):
    monkeypatch.setattr("station.serving.guard.FIRST_REQUEST_S", 1.0)
    monkeypatch.setattr("station.serving.guard.NEXT_REQUEST_S", 2.0)
    monkeypatch.setattr("station.serving.guard.STALLED_S", 1.0)


class Door:
    def __init__(self, listener, under_way, stack):
        self.listener, self.port = listener, listener.getsockname()[1]
        self.under_way, self._stack = under_way, stack

    async def come(self, source=STRANGER):
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port, local_addr=(source, 0))
        self._stack.push_async_callback(self.leave, writer)
        return reader, writer

    @staticmethod
    async def leave(writer):
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()

    async def is_served(self, source=STRANGER, request=REQUEST):
        """Return whether a new connection's request is answered."""
        reader, writer = await self.come(source)
        writer.write(request)
        return await answered(reader)


async def answered(reader):
    with contextlib.suppress(OSError):
        async with asyncio.timeout(LIMIT_S):
            return (await reader.readline()).startswith(b"HTTP/1.1 200")
    return False


async def ended(reader):
    with contextlib.suppress(ConnectionError):
        async with asyncio.timeout(LIMIT_S):
            return await reader.read() == b""
    return True


def files():
    """Count the files that this process has open, the connections of clients and server among them."""
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.fixture
def door():
    """Run a coroutine of a server's door in a loop of its own."""

    def run(steps, limits=LIMITS):
        async def serve():
            hold, under_way = asyncio.Event(), []

            async def long(_):
                under_way.append(1)
                await hold.wait()
                return Response()

            async def endless(_):
                async def pieces():
                    while True:
                        yield bytes(1_000_000)
                        await asyncio.sleep(0)  # what has no client to send to does not wait

                return StreamingResponse(pieces())

            routes = [
                Route("/endless", endless),
                Route("/", lambda _: PlainTextResponse("here")),
                Route("/large", lambda _: Response(bytes(50_000_000))),
                Route("/long", long),
            ]
            listener = listen("127.0.0.1", 0, "hmi", "the pages", limits, lambda address: address == KNOWN)
            server = Server(listener, Starlette(routes=routes), lifespan="off")
            serving = asyncio.create_task(server.run_until_exit())
            await until(lambda: server.started, LIMIT_S)
            async with contextlib.AsyncExitStack() as stack:
                await steps(Door(listener, under_way, stack))
                hold.set()
            server.should_exit = True
            await serving

        asyncio.run(serve())

    return run


def test_silent_connections_make_room_and_end(door):
    async def steps(door):
        silent = [(await door.come())[0] for _ in range(60)]
        assert await door.is_served(), "from the same address"
        assert await door.is_served(ANOTHER)
        assert door.listener.flooded_by == STRANGER
        assert all([await ended(reader) for reader in silent])

    door(steps)


@pytest.mark.parametrize("sent", [b"", REQUEST[:-1], REQUEST], ids=["silent", "half a header", "whole requests"])
def test_a_request_among_a_crowd_of_its_own_address_is_answered(door, sent):
    async def steps(door):
        with contextlib.ExitStack() as stack:

            def come(count, sent):
                """Without a turn of the server meanwhile."""
                clients = [socket.create_connection(("127.0.0.1", door.port), 20, (STRANGER, 0)) for _ in range(count)]
                for client in clients:
                    stack.callback(client.close)
                    client.sendall(sent)
                return clients

            come(30, sent)
            (person,) = come(1, REQUEST)
            come(90, sent)
            person.setblocking(False)
            async with asyncio.timeout(LIMIT_S):
                assert (await asyncio.get_running_loop().sock_recv(person, 15)).startswith(b"HTTP/1.1 200")

    door(steps, AS_PAGES)


def test_who_speaks_is_not_displaced_by_silent_clients(door, monkeypatch):
    monkeypatch.setattr("station.serving.guard.FIRST_REQUEST_S", 30.0)

    async def steps(door):
        reader, writer = await door.come()
        writer.write(REQUEST[:-2])  # as a TLS handshake that is not finished yet
        for _ in range(12):
            await door.come()
        writer.write(REQUEST[-2:])
        assert await answered(reader)

    door(steps)


def test_half_a_header_ends_in_time_and_a_drip_does_not_prolong_it(door):
    async def steps(door):
        reader, writer = await door.come()
        for letter in REQUEST[:-1].decode() * 3:
            with contextlib.suppress(OSError):
                writer.write(letter.encode())
                await asyncio.sleep(0.1)
            if reader.at_eof():
                break
        assert await ended(reader)

    door(steps)


def test_after_an_answer_the_next_request_has_its_time_again(door):
    async def steps(door):
        reader, writer = await door.come()
        writer.write(REQUEST)
        assert await answered(reader)
        await asyncio.sleep(1.3)  # more than the first request's time
        writer.write(REQUEST)
        async with asyncio.timeout(LIMIT_S):
            assert b"HTTP/1.1 200" in await reader.readuntil(b"here") + await reader.readuntil(b"here")
        writer.write(REQUEST[:10])
        async with asyncio.timeout(LIMIT_S):
            await reader.read()

    door(steps)


@pytest.mark.parametrize("request_", [LARGE, ENDLESS], ids=["in one piece", "in pieces"])
def test_a_client_that_does_not_take_its_response_ends(door, request_):
    async def steps(door):
        before = files()
        with socket.create_connection(("127.0.0.1", door.port)) as deaf:
            deaf.sendall(request_)
            await until(lambda: files() == before + 2, LIMIT_S)
            await until(lambda: files() == before + 1, LIMIT_S)
        assert await door.is_served()

    door(steps)


def test_requests_under_way_do_not_give_way_and_leave_the_reserve_alone(door):
    async def steps(door):
        for source in (STRANGER, ANOTHER):
            for _ in range(4):
                (await door.come(source))[1].write(LONG)
        await until(lambda: len(door.under_way) == 8, LIMIT_S)
        assert not await door.is_served("127.0.0.7")
        assert await door.is_served(KNOWN)

    door(steps)


def test_a_place_is_held_until_the_request_of_who_left_is_done(door):
    async def steps(door):
        for _ in range(4):
            _, writer = await door.come()
            writer.write(LONG)
            before = len(door.under_way)
            await until(lambda before=before: len(door.under_way) > before, LIMIT_S)
            await door.leave(writer)
        assert not await door.is_served()
        assert await door.is_served(ANOTHER)

    door(steps)


@pytest.mark.parametrize(
    ("address", "own"),
    [
        ("127.0.0.1", True),
        ("::1", True),
        ("::ffff:127.0.0.1", True),
        ("::12", False),
        ("192.0.2.1", False),
        ("0.0.0.0", False),
        ("::", False),
        ("224.0.0.1", False),
        ("", False),
        ("a name", False),
    ],
)
def test_which_addresses_are_this_machines(address, own):
    assert is_this_machines(address) is own


def test_without_a_file_descriptor_who_is_no_loopback_is_a_stranger(monkeypatch, card_address):
    def none_left(*_):
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(socket, "socket", none_left)
    assert not is_this_machines(card_address)
    assert is_this_machines("127.0.0.1")


def test_the_address_of_its_network_card_is_this_machines(card_address):
    assert is_this_machines(card_address)
