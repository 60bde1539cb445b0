"""TIA Portal: data types and data blocks as an external source in SCL.

A data block with standard access has the memory layout of its declaration, the high byte first (Siemens, "Programming
Guideline for S7-1200/S7-1500", standard and optimized blocks), so MB_CLIENT can copy registers straight onto it. 64-bit
numbers become two, because the S7-1200 has none.
"""

from collections.abc import Iterator

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.type_names import NAMES, flags, meaning_and_unit
from plc_interface.registers.map import GROUPS
from plc_interface.registers.register import Kind, Register


def tia() -> str:
    """The file `tia-portal.scl`."""
    lines = [f"// {MADE_BY} {UNTESTED}", "// The station has the high word first.", ""]
    for group in GROUPS:
        lines += [
            f'TYPE "FruitStation_{group.name}"',
            f"TITLE = {group.title}: registers {group.address} to {group.end - 1}",
            "VERSION : 0.1",
            "   STRUCT",
            *(f"      {row}" for register in group.registers for row in _rows(register)),
            "   END_STRUCT;",
            "END_TYPE",
            "",
        ]
    for group in GROUPS:
        lines += [
            f'DATA_BLOCK "FruitStation_{group.name}_DB"',
            "{ S7_Optimized_Access := 'FALSE' }",
            "VERSION : 0.1",
            "NON_RETAIN",
            f'   "FruitStation_{group.name}"',
            "BEGIN",
            "END_DATA_BLOCK",
            "",
        ]
    return "\n".join(lines)


def _rows(register: Register) -> Iterator[str]:
    comment = meaning_and_unit(register)
    if bits := flags(register, "X"):
        comment += f"; {bits}"
    match register.kind:
        case Kind.U64:
            yield f'"{register.name}_high" : UDInt;   // {comment}, upper half'
            yield f'"{register.name}_low" : UDInt;   // {comment}, lower half'
        case Kind.TEXT:
            yield f'"{register.name}" : Array[0..{2 * register.words - 1}] of Char;   // {comment}'
        case _:
            yield f'"{register.name}" : {NAMES[register.kind].siemens};   // {comment}'
