"""Function codes that read: 1 to 4 (MODBUS Application Protocol Specification V1.1b3, sections 6.1 to 6.4).

1 and 2 read the same flags, 3 and 4 the same registers.
"""

import struct
from typing import NoReturn

from plc_interface.server.exceptions import illegal_value
from plc_interface.server.image import RegisterImage

MOST_REGISTERS = 125
MOST_BITS = 2000


def read_registers(image: RegisterImage, message: bytes) -> bytes:
    """Function codes 3 and 4, from a PDU with its function code.

    Raises:
        RequestError: 02 or 03.
    """
    function, address, count = unpacked(">BHH", message)
    registers = checked_registers(image, address, count)
    return bytes((function, len(registers))) + registers


def read_bits(image: RegisterImage, message: bytes) -> bytes:
    """Function codes 1 and 2; arguments and errors as `read_registers`."""
    function, address, count = unpacked(">BHH", message)
    if not 1 <= count <= MOST_BITS:
        raise illegal_value(f"{count} bits were asked for: ask for 1 to {MOST_BITS}")
    bits = image.bits(address, count)
    return bytes((function, len(bits))) + bits


def checked_registers(image: RegisterImage, address: int, count: int) -> bytes:
    """Return registers on the wire, if a response can hold the count; else RequestError 02 or 03."""
    if not 1 <= count <= MOST_REGISTERS:
        raise illegal_value(f"{count} registers were asked for: ask for 1 to {MOST_REGISTERS}")
    return image.registers(address, count)


def unpacked(layout: str, message: bytes) -> tuple[int, ...]:
    """Return a PDU's numbers; RequestError 03 where its length is not the layout's."""
    if len(message) != struct.calcsize(layout):
        refuse_length(message)
    return struct.unpack(layout, message)


def refuse_length(message: bytes) -> NoReturn:
    """Raise for a PDU whose length differs from its function code and its own counts."""
    raise illegal_value(f"a message of {len(message)} bytes is not what function {message[0]} takes")
