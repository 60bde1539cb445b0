"""Conversion between a value and its registers."""

import math
import struct
from collections.abc import Sequence
from enum import StrEnum

from plc_interface.registers.register import FORMATS, Kind, Register
from station.errors import BadInputError


class WordOrder(StrEnum):
    """Order of the registers of a 32- or 64-bit value; the bytes in a register are always big-endian."""

    HIGH_FIRST = "high_first"
    """As in the Modbus specification's spirit, and the default: 0x12345678 is 0x1234, 0x5678."""
    LOW_FIRST = "low_first"
    """0x12345678 is 0x5678, 0x1234; four registers are reversed as a whole."""


class RegisterValueError(BadInputError):
    """A value that a register cannot hold, or must not."""


def encode(register: Register, value: float | str | None, order: WordOrder = WordOrder.HIGH_FIRST) -> tuple[int, ...]:
    """Return the registers' contents for a value, `register.words` numbers from 0 to 65535.

    Args:
        register: the value's register; its bounds are not checked here, see `problem`.
        value: a number, a text for TEXT, or None for the register's own invalid value (0x80000000 for the area in
            mm²/100, NaN for the area in mm², 0xFFFFFFFF for the one in px, 0x8000 for closing, 0xFFFF for confidence).
        order: of the words of a number.

    Raises:
        RegisterValueError: the kind cannot hold the value, or there is no invalid value.
    """
    if value is None:
        if register.invalid is None:
            raise RegisterValueError(f"{register.name} has no invalid value: give one that it can hold")
        value = register.invalid
    if register.kind is Kind.TEXT:
        return _encode_text(register, value)
    try:
        raw = struct.pack(FORMATS[register.kind], value)
    except (struct.error, OverflowError) as error:
        message = f"{register.name} is of type {register.kind} and cannot hold {value!r}"
        raise RegisterValueError(message) from error
    words = struct.unpack(f">{register.words}H", raw)
    return words if order is WordOrder.HIGH_FIRST else words[::-1]


def decode(register: Register, words: Sequence[int], order: WordOrder = WordOrder.HIGH_FIRST) -> int | float | str:
    """Return the value of registers; an invalid value is returned as it is, compare it by `is_invalid`.

    Args:
        words: `register.words` numbers from 0 to 65535.
        order: of the words of a number.

    Raises:
        RegisterValueError: another count of words, or a text that is not printable ASCII.
    """
    if len(words) != register.words:
        raise RegisterValueError(f"{register.name} lies in {register.words} registers, not in {len(words)}")
    if register.kind is Kind.TEXT:
        return _decode_text(register, words)
    ordered = words if order is WordOrder.HIGH_FIRST else words[::-1]
    return struct.unpack(FORMATS[register.kind], struct.pack(f">{len(ordered)}H", *ordered))[0]


def is_invalid(register: Register, value: float | str) -> bool:
    """Return whether the value is the register's own "there is none"."""
    if register.invalid is None or isinstance(value, str):
        return False
    return math.isnan(value) if math.isnan(register.invalid) else value == register.invalid


def problem(register: Register, value: float | str) -> str:
    """Return why a decoded value must not be in its register, as one sentence; empty if it may."""
    if isinstance(value, str) or is_invalid(register, value):
        return ""
    if register.codes:
        if value not in register.codes:
            known = ", ".join(f"{number} {code.name}" for number, code in register.codes.items())
            return f"{register.name} knows no value {value}; there are: {known}"
        return ""
    if register.bits and int(value) & ~register.mask:
        return f"{register.name} has no meaning for the bits {int(value) & ~register.mask:#06x}: leave them 0"
    if register.low is not None and register.high is not None and not register.low <= value <= register.high:
        return f"{register.name} goes from {register.low:g} to {register.high:g}, not {value}"
    return ""


def _encode_text(register: Register, value: float | str) -> tuple[int, ...]:
    length = 2 * register.words
    if not isinstance(value, str) or not (value.isascii() and (value.isprintable() or not value)):
        raise RegisterValueError(f"{register.name} holds printable ASCII characters only, not {value!r}")
    if len(value) > length:
        raise RegisterValueError(f"{register.name} holds {length} characters, not the {len(value)} of {value!r}")
    return struct.unpack(f">{register.words}H", value.encode("ascii").ljust(length, b"\0"))


def _decode_text(register: Register, words: Sequence[int]) -> str:
    """Return the text up to the first NUL, without the spaces with which some PLCs fill a text up."""
    raw = struct.pack(f">{len(words)}H", *words)
    # Latin-1 decodes every byte, so that the check below refuses what is not ASCII.
    text = raw.split(b"\0", 1)[0].rstrip(b" ").decode("latin-1")
    if not text.isascii() or not (text.isprintable() or not text):
        raise RegisterValueError(f"{register.name} holds printable ASCII characters only, not {raw!r}")
    return text
