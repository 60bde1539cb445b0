"""Function codes that write: 5, 6, 15, 16, 22, 23, as field values and responses.

Source: MODBUS Application Protocol Specification V1.1b3, sections 6.5, 6.6, 6.11, 6.12, 6.16, 6.17.
"""

import struct
from collections.abc import Callable
from typing import NamedTuple

from plc_interface.registers.register import Value
from plc_interface.server.exceptions import illegal_value
from plc_interface.server.image import RegisterImage
from plc_interface.server.reading import checked_registers, refuse_length, unpacked

MOST_REGISTERS = 123
MOST_REGISTERS_BESIDE_A_READ = 121
MOST_BITS = 1968
_COIL = {0x0000: 0, 0xFF00: 1}


class Write(NamedTuple):
    """A checked write, not carried out yet."""

    values: dict[str, Value]
    """By the names of whole fields."""
    response: Callable[[], bytes]
    """The message that answers it, once it is carried out."""


Parser = Callable[[RegisterImage, bytes], Write]
"""Checks a message, from its function code on; raises RequestError 02 or 03."""


def write_coil(image: RegisterImage, message: bytes) -> Write:
    """Function code 5."""
    _, address, value = unpacked(">BHH", message)
    if value not in _COIL:
        raise illegal_value(f"a coil is written as 0x0000 or 0xFF00, not {value:#06x}")
    return Write(image.written_bits(address, 1, _COIL[value]), lambda: message)


def write_register(image: RegisterImage, message: bytes) -> Write:
    """Function code 6."""
    _, address, _ = unpacked(">BHH", message)
    return Write(image.written(address, message[3:]), lambda: message)


def write_coils(image: RegisterImage, message: bytes) -> Write:
    """Function code 15."""
    _, address, count = unpacked(">BHH", message[:5])
    if not 1 <= count <= MOST_BITS:
        raise illegal_value(f"{count} coils were to be written: write 1 to {MOST_BITS}")
    raw = _counted(message, 5, (count + 7) // 8)
    bits = int.from_bytes(raw, "little") & (1 << count) - 1
    return Write(image.written_bits(address, count, bits), lambda: message[:5])


def write_registers(image: RegisterImage, message: bytes) -> Write:
    """Function code 16."""
    _, address, count = unpacked(">BHH", message[:5])
    raw = _registers(message, 5, count, MOST_REGISTERS)
    return Write(image.written(address, raw), lambda: message[:5])


def mask_write_register(image: RegisterImage, message: bytes) -> Write:
    """Function code 22."""
    _, address, and_mask, or_mask = unpacked(">BHHH", message)
    word = image.word(address) & and_mask | or_mask & ~and_mask & 0xFFFF
    return Write(image.written(address, struct.pack(">H", word)), lambda: message)


def read_write_registers(image: RegisterImage, message: bytes) -> Write:
    """Function code 23: the read follows the write."""
    _, read_address, read_count, write_address, write_count = unpacked(">BHHHH", message[:9])
    raw = _registers(message, 9, write_count, MOST_REGISTERS_BESIDE_A_READ)
    checked_registers(image, read_address, read_count)

    def response() -> bytes:
        return bytes((message[0], 2 * read_count)) + image.registers(read_address, read_count)

    return Write(image.written(write_address, raw), response)


def _registers(message: bytes, at: int, count: int, most: int) -> bytes:
    if not 1 <= count <= most:
        raise illegal_value(f"{count} registers were to be written: write 1 to {most}")
    return _counted(message, at, 2 * count)


def _counted(message: bytes, at: int, size: int) -> bytes:
    """Return the data behind its own count of bytes, which has to match the PDU."""
    if len(message) != at + 1 + size or message[at] != size:
        refuse_length(message)
    return message[at + 1 :]
