"""ADU framing of Modbus TCP: the MBAP header.

Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, section 3.1.3: transaction, protocol 0, length of what
follows, unit; then the message itself, at most 253 bytes.
"""

import struct
from collections.abc import Iterator

from plc_interface.server.exceptions import MalformedFrameError

LONGEST_MESSAGE = 253
HEADER_SIZE = 7
LONGEST_FRAME = HEADER_SIZE + LONGEST_MESSAGE

_HEADER = struct.Struct(">HHHB")

Frame = tuple[int, int, bytes]
"""Transaction, unit, and the message from its function code on."""


def frames(received: bytearray | bytes, size: int) -> Iterator[tuple[Frame, int]]:
    """Yield every complete ADU in the first `size` bytes, each with the number of bytes up to its end.

    Raises:
        MalformedFrameError: after the good ones, at a header that is no Modbus TCP.
    """
    begin = 0
    while size - begin >= HEADER_SIZE:
        transaction, protocol, length, unit = _HEADER.unpack_from(received, begin)
        if protocol != 0:
            raise MalformedFrameError(f"protocol {protocol} instead of 0")
        if not 2 <= length <= LONGEST_MESSAGE + 1:
            raise MalformedFrameError(f"a length of {length}, not 2 to {LONGEST_MESSAGE + 1}")
        end = begin + 6 + length
        if end > size:
            return
        yield (transaction, unit, bytes(received[begin + HEADER_SIZE : end])), end
        begin = end


def framed(transaction: int, unit: int, message: bytes) -> bytes:
    """Return a PDU, from its function code on, with the header of its request's transaction (0 to 65535) and unit."""
    return _HEADER.pack(transaction, 0, 1 + len(message), unit) + message
