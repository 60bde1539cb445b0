"""Server of a channel."""

import asyncio
import logging
import math
import time
from collections.abc import Awaitable, Callable, Mapping
from contextvars import ContextVar
from typing import Any

import zmq
import zmq.asyncio
from pydantic import ValidationError

from station.channel.messages import ENVELOPE, LARGEST_MESSAGE_BYTES, ChannelMessage, check_endpoint
from station.errors import StationError
from station.messages import channel as messages
from station.messages.message import Message, verbatim

Handler = Callable[[Any], Awaitable[ChannelMessage]]
"""Takes the request that it is registered for and gives the reply."""
Handlers = Mapping[type[ChannelMessage], Handler]

log = logging.getLogger(__name__)

_EXPIRES_S = ContextVar("expires_s", default=math.inf)
"""Of the request that this task handles; monotonic."""


def is_expired() -> bool:
    """Return whether the client of the request that is handled has stopped waiting for its answer."""
    return time.monotonic() > _EXPIRES_S.get()


class ChannelServer:
    """Server for any number of clients; each request has a task of its own."""

    def __init__(self, endpoint: str, handlers: Handlers) -> None:
        """Bind the endpoint.

        Args:
            endpoint: `ipc://PATH` or `tcp://127.…:PORT`.
            handlers: the function for each type of request. A handler's `StationError` is the refusal that the client
                receives; any other exception is logged and sent as a failure.

        Raises:
            BadInputError: the endpoint is not a local one.
            zmq.ZMQError: the endpoint cannot be bound.
        """
        self._handlers = {kind.__name__: (kind, handler) for kind, handler in handlers.items()}
        self._context = zmq.asyncio.Context()
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, LARGEST_MESSAGE_BYTES)
        self._tasks: set[asyncio.Task[None]] = set()
        try:
            self._socket.bind(check_endpoint(endpoint))
        except BaseException:
            self._close()
            raise

    async def serve(self) -> None:
        """Answer until cancelled; pending requests are then cancelled too."""
        try:
            while True:
                frames = await self._socket.recv_multipart()
                if len(frames) != 4 or len(frames[1]) != ENVELOPE.size:
                    log.warning("a channel message of %d frames was dropped", len(frames))
                    continue
                task = asyncio.create_task(self._answer(*frames))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            self._close()

    def _close(self) -> None:
        self._socket.close(linger=0)
        self._context.term()

    async def _answer(self, client: bytes, envelope: bytes, name: bytes, body: bytes) -> None:
        _EXPIRES_S.set(ENVELOPE.unpack(envelope)[1])
        status, answer = await self._carry_out(name.decode("utf-8", "replace"), body)
        await self._socket.send_multipart([client, envelope, status, answer])

    async def _carry_out(self, name: str, body: bytes) -> tuple[bytes, bytes]:
        if is_expired():
            return _refused(messages.TOO_LATE(request=name))
        if name not in self._handlers:
            return _refused(messages.UNKNOWN_REQUEST(request=name))
        kind, handler = self._handlers[name]
        try:
            request = kind.model_validate_json(body)
        except ValidationError as error:
            return _refused(messages.MALFORMED_REQUEST(request=name, why=str(error)))
        try:
            reply = await handler(request)
        except StationError as error:
            return _refused(error.message)
        except Exception as error:  # a handler's bug must not end the server
            log.exception("the handler of %s failed", name)
            return _refused(verbatim(f"{type(error).__name__}: {error}"))
        return b"ok", reply.model_dump_json().encode()


def _refused(why: Message) -> tuple[bytes, bytes]:
    return b"refused", why.model_dump_json().encode()
