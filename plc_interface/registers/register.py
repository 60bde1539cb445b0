"""Register definition: access, kind, flags, codes."""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple


class Access(StrEnum):
    """Writers of a register."""

    READ_ONLY = "read only"
    READ_WRITE = "read and write"


class Kind(StrEnum):
    """Data type of a value in its registers."""

    U16 = "u16"
    I16 = "i16"
    U32 = "u32"
    I32 = "i32"
    U64 = "u64"
    F32 = "f32"
    """IEEE 754 binary32."""
    TEXT = "text"
    """ASCII, two characters a register, the first in the high byte, filled up with NUL; never in another word order."""
    BITS = "bits16"
    BITS32 = "bits32"


FORMATS = {
    Kind.U16: ">H",
    Kind.BITS: ">H",
    Kind.I16: ">h",
    Kind.U32: ">I",
    Kind.BITS32: ">I",
    Kind.I32: ">i",
    Kind.U64: ">Q",
    Kind.F32: ">f",
}
"""Of `struct`, high word first, for every kind but TEXT."""
_WORDS = {kind: struct.calcsize(layout) // 2 for kind, layout in FORMATS.items()}
Value = int | float | str | None
"""A register's value; None where there is none and the register has a value that says so."""


@dataclass(frozen=True, slots=True)
class Bit:
    """One flag, counted from the value's least significant bit, which is 0."""

    number: int
    name: str
    meaning: str


class Code(NamedTuple):
    """One value of an enumeration."""

    name: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Register:
    """One value of the map, in one or more registers."""

    name: str
    address: int
    """PDU address of its first register, from 0."""
    kind: Kind
    access: Access
    unit: str
    """Empty for a number without one."""
    low: float | None
    """Smallest valid value; None for texts and bits, and where the kind is the bound."""
    high: float | None
    meaning: str
    bits: tuple[Bit, ...] = ()
    """Every flag that has a meaning; the others are 0 and stay so."""
    codes: Mapping[int, Code] = field(default_factory=dict, hash=False)
    """The only valid values of an enumeration; empty for what is none."""
    invalid: float | None = None
    """The value that says that there is none, such as 0x80000000 for an area; valid outside the bounds."""
    text_words: int = 0
    """Registers of a TEXT, two characters each."""

    @property
    def words(self) -> int:
        """Number of registers of the value."""
        return self.text_words if self.kind is Kind.TEXT else _WORDS[self.kind]

    @property
    def end(self) -> int:
        """The first address after the register."""
        return self.address + self.words

    @property
    def mask(self) -> int:
        """All flags with a meaning."""
        return sum(1 << bit.number for bit in self.bits)

    def flags(self, names: Iterable[str]) -> int:
        """Return the value in which exactly these flags are set; KeyError for an unknown name."""
        numbers = {bit.name: bit.number for bit in self.bits}
        return sum(1 << numbers[name] for name in frozenset(names))

    def names(self, value: int) -> frozenset[str]:
        """Return the flags that are set in a value; those without a meaning are left out."""
        return frozenset(bit.name for bit in self.bits if value >> bit.number & 1)

    def code(self, name: str) -> int:
        """Return the value of an enumeration's name; KeyError for an unknown name."""
        return {code.name: value for value, code in self.codes.items()}[name]
