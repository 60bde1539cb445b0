"""Names of the registers' types in the languages and tools that files are generated for."""

from typing import NamedTuple

from plc_interface.registers.alarms import ALARMS
from plc_interface.registers.register import Kind, Register


class Names(NamedTuple):
    """Names of one type."""

    iec: str
    """IEC 61131-3."""
    siemens: str
    """Empty for a type that TIA Portal's data blocks do not get."""
    logix: str
    """Logix numbers are signed: an unsigned one over half its range reads as negative."""
    telegraf: str
    ignition: tuple[str, str]
    """The designator of Modbus addresses, and the tag's data type."""


NAMES = {
    Kind.U16: Names("UINT", "UInt", "INT", "UINT16", ("HRUS", "Int4")),
    Kind.BITS: Names("WORD", "Word", "INT", "UINT16", ("HRUS", "Int4")),
    Kind.I16: Names("INT", "Int", "INT", "INT16", ("HR", "Int2")),
    Kind.TEXT: Names("WORD", "", "INT", "STRING", ("HRS", "String")),
    Kind.U32: Names("UDINT", "UDInt", "DINT", "UINT32", ("HRUI", "Int8")),
    Kind.BITS32: Names("DWORD", "DWord", "DINT", "UINT32", ("HRUI", "Int8")),
    Kind.I32: Names("DINT", "DInt", "DINT", "INT32", ("HRI", "Int4")),
    Kind.U64: Names("ULINT", "", "LINT", "UINT64", ("HRUI_64", "Int8")),
    Kind.F32: Names("REAL", "Real", "REAL", "FLOAT32", ("HRF", "Float4")),
}


def meaning_and_unit(register: Register) -> str:
    """Return a register's meaning with its unit, for a comment."""
    return register.meaning + (f", {register.unit}" if register.unit else "")


def flags(register: Register, mark: str = "") -> str:
    """Return a register's flags as numbers, each after a mark, and names; empty for alarms, which have only numbers."""
    return "" if register in ALARMS else ", ".join(f"{mark}{bit.number} {bit.name}" for bit in register.bits)
