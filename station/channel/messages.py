"""Base of all messages on a channel, and the channel's errors."""

import struct

from pydantic import BaseModel, ConfigDict

from station.errors import BadInputError, StationError

ENVELOPE = struct.Struct(">Qd")
"""The request's number, and its deadline on the monotonic clock that all processes of a machine share, s."""

LARGEST_MESSAGE_BYTES = 16 * 1024 * 1024


class ChannelMessage(BaseModel):
    """A request or a reply: strict, frozen, nothing unknown. Its class name is its name on the wire."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class ChannelError(StationError):
    """A request without a valid answer."""


class DeadlineError(ChannelError):
    """No answer came in time; whether the request was carried out is unknown."""


class RefusedError(ChannelError):
    """The server answered that it did not carry the request out."""


def check_endpoint(endpoint: str) -> str:
    """Refuse an address that another machine can reach.

    Raises:
        BadInputError: the endpoint is neither `ipc://PATH` nor `tcp://127.…:PORT`.
    """
    if endpoint.startswith(("ipc://", "tcp://127.")):
        return endpoint
    raise BadInputError(f"channel endpoint {endpoint!r}: expected ipc://PATH or tcp://127.0.0.1:PORT")
