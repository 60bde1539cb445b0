"""Modbus frames that are wrong in one known way each, with the answer that each must get: an oracle for a server."""

import random
import struct
from typing import NamedTuple

from plc_interface.registers.map import BY_NAME

GOOD = struct.pack(">BHH", 3, BY_NAME["reference_u16"].address, 1)
GOOD_ANSWER = bytes([3, 2, 0x12, 0x34])
CLOSED = 0
"""Instead of an exception code: the connection has to end."""
UNIT = 1
KNOWN = (1, 2, 3, 4, 5, 6, 15, 16, 22, 23, 43)
GAP = 60
"""A register that the map does not have."""


class Malformed(NamedTuple):
    """One thing to send on a connection that expects a new frame."""

    kind: str
    data: bytes
    code: int
    """The exception code that has to answer it, or CLOSED."""
    half_close: bool = False
    """The client ends its side behind it."""


def _frame(
    source: random.Random, message: bytes, *, protocol: int = 0, length: int | None = None, unit: int = UNIT
) -> bytes:
    size = len(message) + 1 if length is None else length
    return struct.pack(">HHHB", source.getrandbits(16), protocol, size, unit) + message


def _read(source: random.Random) -> bytes:
    return struct.pack(">BHH", source.choice((3, 4)), 100, source.randint(1, 20))


def wrong_protocol(source: random.Random) -> Malformed:
    """A protocol other than Modbus."""
    return Malformed("protocol", _frame(source, _read(source), protocol=source.randint(1, 65_535)), CLOSED)


def wrong_length(source: random.Random) -> Malformed:
    """A length that no frame has."""
    length = source.choice((0, 1, 255, 256, source.randint(257, 65_535)))
    return Malformed("length", _frame(source, _read(source), length=length), CLOSED)


def truncated(source: random.Random) -> Malformed:
    """A frame without its end."""
    whole = _frame(source, _read(source))
    return Malformed("truncated", whole[: source.randint(1, len(whole) - 1)], CLOSED, half_close=True)


def length_beyond_what_comes(source: random.Random) -> Malformed:
    """A length beyond the bytes that follow."""
    return Malformed(
        "too long a length", _frame(source, _read(source), length=source.randint(7, 254)), CLOSED, half_close=True
    )


def garbage(source: random.Random) -> Malformed:
    """Random bytes."""
    data = bytearray(source.randbytes(source.randint(7, 400)))
    data[2] |= 1  # else a few of them would be fit to be read
    return Malformed("garbage", bytes(data), CLOSED)


def unknown_function(source: random.Random) -> Malformed:
    """A function code that is not supported."""
    function = source.choice([code for code in range(256) if code not in KNOWN])
    return Malformed("function", _frame(source, bytes([function]) + source.randbytes(source.randint(0, 252))), 1)


def unknown_unit(source: random.Random) -> Malformed:
    """Another unit's identifier."""
    unit = source.choice([each for each in range(256) if each not in {UNIT, 0, 255}])
    return Malformed("unit", _frame(source, _read(source), unit=unit), 11)


def wrong_size(source: random.Random) -> Malformed:
    """A request of a wrong size."""
    function = source.choice((1, 2, 3, 4, 5, 6, 22))
    right = 7 if function == 22 else 5
    size = source.choice([each for each in range(1, 30) if each != right])
    return Malformed("size", _frame(source, bytes([function]) + bytes(size - 1)), 3)


def wrong_count(source: random.Random) -> Malformed:
    """A count of registers or bits out of range."""
    function, most = source.choice(((1, 2000), (2, 2000), (3, 125), (4, 125)))
    count = source.choice((0, source.randint(most + 1, 65_535)))
    return Malformed("count", _frame(source, struct.pack(">BHH", function, 100, count)), 3)


def wrong_byte_count(source: random.Random) -> Malformed:
    """A byte count that contradicts the number of registers."""
    count = source.randint(1, 20)
    byte_count = source.choice([each for each in range(256) if each != 2 * count])
    return Malformed("byte count", _frame(source, struct.pack(">BHHB", 16, 0, count, byte_count) + bytes(2 * count)), 3)


def unmapped(source: random.Random) -> Malformed:
    """Registers that the map does not have."""
    address = source.randint(GAP - 3, GAP)
    function = source.choice((3, 4, 6, 22))
    rest = {3: (8,), 4: (8,), 6: (1,), 22: (0, 1)}[function]
    return Malformed("address", _frame(source, struct.pack(f">BH{len(rest)}H", function, address, *rest)), 2)


def read_only(source: random.Random) -> Malformed:
    """A write to a register that can only be read."""
    return Malformed("read only", _frame(source, struct.pack(">BHH", 6, source.randint(100, 161), 1)), 2)


def half_written(source: random.Random) -> Malformed:
    """A write to half of a 32- or 64-bit value."""
    return Malformed("half", _frame(source, struct.pack(">BHH", 6, source.choice((2, 3, 8, 9, 10, 25)), 1)), 3)


KINDS = (
    wrong_protocol,
    wrong_length,
    truncated,
    length_beyond_what_comes,
    garbage,
    unknown_function,
    unknown_unit,
    wrong_size,
    wrong_count,
    wrong_byte_count,
    unmapped,
    read_only,
    half_written,
)


def in_parts(source: random.Random, data: bytes) -> list[bytes]:
    """The same bytes, cut at random places."""
    cuts = sorted(source.randint(0, len(data)) for _ in range(source.choice((0, 0, 1, 3))))
    return [data[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(data)], strict=True) if begin < end]
