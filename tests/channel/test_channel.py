"""The channel between two processes, here between two tasks."""

import asyncio
import struct
import time

import pytest
import zmq
import zmq.asyncio
from hypothesis import given
from hypothesis import strategies as st

from station.channel.client import ChannelClient
from station.channel.messages import ChannelError, ChannelMessage, DeadlineError, RefusedError, check_endpoint
from station.channel.server import ChannelServer, Handlers
from station.errors import BadInputError, StationError


class Add(ChannelMessage):
    a: int
    b: int


class Sleep(ChannelMessage):
    duration_s: float


class Refuse(ChannelMessage):
    pass


class Break(ChannelMessage):
    pass


class Unknown(ChannelMessage):
    pass


class Sum(ChannelMessage):
    total: int


class Other(ChannelMessage):
    text: str


class Peer:
    """A server with some handlers, and what it carried out."""

    def __init__(self) -> None:
        self.started = []
        self.sleeping = asyncio.Event()

    async def add(self, request: Add) -> Sum:
        self.started.append(request)
        return Sum(total=request.a + request.b)

    async def sleep(self, request: Sleep) -> Sum:
        self.sleeping.set()
        await asyncio.sleep(request.duration_s)
        return Sum(total=0)

    async def refuse(self, request: Refuse) -> Sum:
        raise StationError("not today")

    async def fail(self, request: Break) -> Sum:
        raise ZeroDivisionError("a bug")

    async def serve(self, endpoint: str) -> None:
        handlers: Handlers = {Add: self.add, Sleep: self.sleep, Refuse: self.refuse, Break: self.fail}
        await ChannelServer(endpoint, handlers).serve()


def with_peer(tmp_path, body):
    async def run():
        endpoint, peer = f"ipc://{tmp_path}/channel", Peer()
        serving = asyncio.create_task(peer.serve(endpoint))
        try:
            async with ChannelClient(endpoint, "the peer") as client:
                await body(client, peer, endpoint)
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(run())


def test_each_of_many_requests_gets_its_own_answer(tmp_path):
    async def body(client, peer, endpoint):
        answers = await asyncio.gather(*(client.request(Add(a=i, b=i), Sum, deadline_s=5.0) for i in range(100)))
        assert [answer.total for answer in answers] == [2 * i for i in range(100)]

    with_peer(tmp_path, body)


def test_a_slow_answer_is_given_up_and_does_not_hold_up_others(tmp_path):
    async def body(client, peer, endpoint):
        slow = asyncio.create_task(client.request(Sleep(duration_s=30.0), Sum, deadline_s=0.3))
        began_s = time.monotonic()
        assert (await client.request(Add(a=1, b=2), Sum, deadline_s=5.0)).total == 3
        with pytest.raises(DeadlineError, match=r"the peer did not answer Sleep within 0\.3 s"):
            await slow
        assert time.monotonic() - began_s < 10.0
        assert (await client.request(Add(a=2, b=2), Sum, deadline_s=5.0)).total == 4

    with_peer(tmp_path, body)


def test_a_request_that_nobody_took_in_time_is_not_begun_later(tmp_path):
    async def run():
        endpoint, peer = f"ipc://{tmp_path}/channel", Peer()
        async with ChannelClient(endpoint, "the peer") as client:
            with pytest.raises(DeadlineError):
                await client.request(Add(a=1, b=1), Sum, deadline_s=0.1)
            serving = asyncio.create_task(peer.serve(endpoint))
            assert (await client.request(Add(a=2, b=2), Sum, deadline_s=5.0)).total == 4
            assert [request.a for request in peer.started] == [2]
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(run())


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (Refuse(), "not today"),
        (Break(), "ZeroDivisionError: a bug"),
        (Unknown(), "Unknown is no request that this process knows"),
    ],
)
def test_a_refusal_carries_the_peers_words(tmp_path, request_, words):
    async def body(client, peer, endpoint):
        with pytest.raises(RefusedError, match=words):
            await client.request(request_, Sum, deadline_s=5.0)
        assert (await client.request(Add(a=1, b=2), Sum, deadline_s=5.0)).total == 3

    with_peer(tmp_path, body)


def test_an_answer_of_another_type_is_an_error(tmp_path):
    async def body(client, peer, endpoint):
        with pytest.raises(ChannelError, match="something else than Other"):
            await client.request(Add(a=1, b=2), Other, deadline_s=5.0)

    with_peer(tmp_path, body)


def test_rubbish_does_not_end_the_server(tmp_path):
    async def body(client, peer, endpoint):
        context = zmq.asyncio.Context()
        raw = context.socket(zmq.DEALER)
        raw.connect(endpoint)
        envelope = struct.pack(">Qd", 7, time.monotonic() + 60)
        for frames in (
            [b""],
            [b"x"] * 9,
            [b"short", b"Add", b"{}"],
            [envelope, b"\xff\xfe", b"{}"],
            [envelope, b"Add", b"\xff"],
            [envelope, b"Add", b'{"a": "1", "b": 2}'],
            [envelope, b"Add", b'{"a": 1, "b": 2, "c": 3}'],
            [struct.pack(">Qd", 7, float("nan")), b"Add", b'{"a": 1, "b": NaN}'],
        ):
            await raw.send_multipart(frames)
        assert (await client.request(Add(a=1, b=2), Sum, deadline_s=5.0)).total == 3
        assert all(request == Add(a=1, b=2) for request in peer.started)
        raw.close(linger=0)
        context.term()

    with_peer(tmp_path, body)


def test_closing_ends_what_is_under_way(tmp_path):
    async def body(client, peer, endpoint):
        request = asyncio.create_task(client.request(Sleep(duration_s=30.0), Sum, deadline_s=60.0))
        await asyncio.wait_for(peer.sleeping.wait(), 5)
        await client.close()
        with pytest.raises(ChannelError, match="was closed"):
            await request
        await client.close()
        with pytest.raises(ChannelError, match="was closed"):
            await client.request(Sleep(duration_s=0.0), Sum, deadline_s=1.0)

    with_peer(tmp_path, body)


@given(st.text(max_size=40))
def test_only_local_endpoints_pass(text):
    if text.startswith(("ipc://", "tcp://127.")):
        assert check_endpoint(text) == text
    else:
        with pytest.raises(BadInputError, match="expected ipc"):
            check_endpoint(text)


@pytest.mark.parametrize("endpoint", ["tcp://0.0.0.0:5555", "tcp://*:5555", "inproc://x", "ipc:/x", ""])
def test_an_endpoint_that_others_could_reach_is_refused(endpoint):
    with pytest.raises(BadInputError):
        check_endpoint(endpoint)
