"""Client of a channel."""

import asyncio
import contextlib
import itertools
import time
from typing import Self, TypeVar

import zmq
import zmq.asyncio
from pydantic import ValidationError
from zmq.utils.monitor import parse_monitor_message

from station.channel.messages import (
    ENVELOPE,
    LARGEST_MESSAGE_BYTES,
    ChannelError,
    ChannelMessage,
    DeadlineError,
    RefusedError,
    check_endpoint,
)
from station.messages import channel as messages
from station.messages.message import message_in

ReplyT = TypeVar("ReplyT", bound=ChannelMessage)
RECONNECT_MS = 10
_PING_MS, _PONG_MS = 1000, 5000
"""A connection whose server answers no ping within this time is made anew: where a length was spoilt on its way, the
other side waits for bytes that never come. ZeroMQ answers by a thread of its own, also while a server works."""
_GREETING_MS = 2000
"""A connection whose greeting is not answered within this time is made anew; pings begin after it only. By itself
ZeroMQ waits for 30 s."""
_RETRY_SHOWN_S = 0.5
"""ZeroMQ announces within this time after a disconnection that it tries again; after a protocol error it never does."""


class ChannelClient:
    """Client of one server; many requests may be pending at once. Belongs to the event loop that it was made in."""

    def __init__(self, endpoint: str, peer: str) -> None:
        """Start connecting; until a server is there each request waits for it within its deadline.

        Args:
            endpoint: `ipc://PATH` or `tcp://127.…:PORT`.
            peer: name of the server in messages, such as `the arm's process`.

        Raises:
            BadInputError: the endpoint is not a local one.
        """
        self._peer = peer
        self._context = zmq.asyncio.Context()
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_MS)
        self._socket.setsockopt(zmq.MAXMSGSIZE, LARGEST_MESSAGE_BYTES)
        self._socket.setsockopt(zmq.HANDSHAKE_IVL, _GREETING_MS)
        self._socket.setsockopt(zmq.HEARTBEAT_IVL, _PING_MS)
        self._socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, _PONG_MS)
        self._endpoint = check_endpoint(endpoint)
        self._monitor = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED | zmq.EVENT_CONNECT_RETRIED)
        self._socket.connect(self._endpoint)
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[tuple[bytes, bytes]]] = {}
        self._receiving = asyncio.create_task(self._receive(), name=f"channel to {peer}")
        self._reconnecting = asyncio.create_task(self._reconnect(), name=f"connection to {peer}")

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def request(self, request: ChannelMessage, reply: type[ReplyT], *, deadline_s: float) -> ReplyT:
        """Send a request and return its reply within the deadline; a server that receives it later ignores it.

        Raises:
            DeadlineError: no answer came in time.
            RefusedError: the server refused or failed; the message is the server's.
            ChannelError: the answer is not of the reply's type.
        """
        number = next(self._numbers)
        answer: asyncio.Future[tuple[bytes, bytes]] = asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        envelope = ENVELOPE.pack(number, time.monotonic() + deadline_s)
        name = type(request).__name__
        try:
            async with asyncio.timeout(deadline_s):
                await self._socket.send_multipart([envelope, name.encode(), request.model_dump_json().encode()])
                status, body = await answer
        except TimeoutError:
            raise DeadlineError(messages.NO_ANSWER(peer=self._peer, request=name, limit_s=deadline_s)) from None
        except zmq.ZMQError as error:
            raise ChannelError(messages.CHANNEL_CLOSED(peer=self._peer)) from error
        finally:
            self._waiting.pop(number, None)
        if status != b"ok":
            raise RefusedError(message_in(body.decode("utf-8", "replace")) or "")
        try:
            return reply.model_validate_json(body)
        except ValidationError as error:
            raise ChannelError(
                f"{self._peer} answered {name} with something else than {reply.__name__}: {error}"
            ) from error

    async def close(self) -> None:
        """Close the socket; pending requests end with a ChannelError. Idempotent."""
        for task in (self._receiving, self._reconnecting):
            task.cancel()
        await asyncio.gather(self._receiving, self._reconnecting, return_exceptions=True)
        if not self._socket.closed:
            self._socket.disable_monitor()
        self._monitor.close(linger=0)
        self._socket.close(linger=0)
        self._context.term()
        for answer in self._waiting.values():
            if not answer.done():
                answer.set_exception(ChannelError(messages.CHANNEL_CLOSED(peer=self._peer)))

    async def _reconnect(self) -> None:
        """Connect again after a protocol error, as ZeroMQ gives such a connection up for ever."""
        while True:
            event = await _next_event(self._monitor)
            while event == zmq.EVENT_DISCONNECTED:
                try:
                    async with asyncio.timeout(_RETRY_SHOWN_S):
                        event = await _next_event(self._monitor)
                except TimeoutError:
                    with contextlib.suppress(zmq.ZMQError):
                        self._socket.disconnect(self._endpoint)
                    self._socket.connect(self._endpoint)
                    break

    async def _receive(self) -> None:
        while True:
            frames = await self._socket.recv_multipart()
            if len(frames) != 3 or len(frames[0]) != ENVELOPE.size:
                continue
            number, _ = ENVELOPE.unpack(frames[0])
            answer = self._waiting.get(number)
            if answer is not None and not answer.done():
                answer.set_result((frames[1], frames[2]))


async def _next_event(monitor: zmq.asyncio.Socket) -> int:
    """Return the number of the monitor's next event."""
    message = await monitor.recv_multipart()
    return parse_monitor_message(message)["event"]
