"""Formatted register values, for the station's pages."""

from collections.abc import Callable

from plc_interface.registers.map import REGISTERS
from plc_interface.registers.register import Access, Register, Value
from station.channel.line import RegisterView


def formatted_registers(value: Callable[[str], Value]) -> tuple[RegisterView, ...]:
    """Return every register with its formatted value, None being "none", in the order of the addresses."""
    return tuple(
        RegisterView(
            name=register.name,
            address=register.address,
            value=_formatted(register, value(register.name)),
            unit=register.unit,
            writable=register.access is Access.READ_WRITE,
            meaning=register.meaning,
        )
        for register in REGISTERS
    )


def _formatted(register: Register, value: Value) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value
    if register.bits:
        set_bits = [bit.name for bit in register.bits if int(value) >> bit.number & 1]
        return f"{int(value):#06x} {', '.join(set_bits)}".rstrip()
    if code := register.codes.get(int(value)):
        return f"{value} {code.name}"
    return f"{value:g}" if isinstance(value, float) else str(value)
