"""Failed requests: exception codes, and their counters."""

from enum import IntEnum, StrEnum
from functools import partial


class ExceptionCode(IntEnum):
    """MODBUS Application Protocol Specification V1.1b3, section 7."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    BUSY = 6
    """Another client holds the right to write, or the write key is not set."""
    GATEWAY_NO_RESPONSE = 11
    """No such unit."""


class Trouble(StrEnum):
    """Counters and log categories of the server."""

    MALFORMED_FRAME = "malformed frames"
    ILLEGAL_FUNCTION = "unknown functions"
    ILLEGAL_ADDRESS = "wrong addresses"
    ILLEGAL_VALUE = "wrong values"
    UNKNOWN_UNIT = "unknown units"
    NO_RIGHT = "writes without the right"
    NOT_WRITER = "writes beside the writer"
    DEVICE_FAILURE = "internal faults"
    NOT_ALLOWED = "connections not allowed"
    TOO_MANY = "connections over the limit"
    NO_HANDSHAKE = "failed TLS handshakes"
    IDLE = "idle connections"
    UNFINISHED = "unfinished requests"
    SLOW_READER = "replies not taken"


CONNECTION_TROUBLES = frozenset(
    (
        Trouble.NOT_ALLOWED,
        Trouble.TOO_MANY,
        Trouble.NO_HANDSHAKE,
        Trouble.IDLE,
        Trouble.UNFINISHED,
        Trouble.SLOW_READER,
    )
)
"""Those for which a connection was refused or closed by a limit; the others answer or end on a bad request."""


class RequestError(Exception):
    """A request that is answered with an exception response."""

    def __init__(self, code: ExceptionCode, trouble: Trouble, why: str) -> None:
        super().__init__(why)
        self.code, self.trouble = code, trouble


class MalformedFrameError(Exception):
    """Bytes that are no Modbus TCP: the start of the next request is unknown, so the connection has to end."""


illegal_function = partial(RequestError, ExceptionCode.ILLEGAL_FUNCTION, Trouble.ILLEGAL_FUNCTION)
"""Exception 01, by its reason."""
illegal_address = partial(RequestError, ExceptionCode.ILLEGAL_ADDRESS, Trouble.ILLEGAL_ADDRESS)
"""Exception 02."""
illegal_value = partial(RequestError, ExceptionCode.ILLEGAL_VALUE, Trouble.ILLEGAL_VALUE)
"""Exception 03."""
