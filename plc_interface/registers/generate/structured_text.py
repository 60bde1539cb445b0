"""Structured Text (IEC 61131-3 ed. 3) without a vendor's extensions: data types, function block, example."""

from collections.abc import Iterator
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from plc_interface.registers.alarms import ALARMS
from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.type_names import NAMES, meaning_and_unit
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME, MAP_VERSION, map_checksum
from plc_interface.registers.register import Kind, Register

STATUS, RESULT, CONTROL = GROUP_BY_NAME["status"], GROUP_BY_NAME["result"], GROUP_BY_NAME["control"]
MORE_STATUS = GROUP_BY_NAME["more_status"]
_NUMBERS = frozenset({Kind.U16, Kind.I16, Kind.U32, Kind.I32, Kind.BITS, Kind.BITS32})
ARRAYS = {
    "T_FruitStationRead": MORE_STATUS.end - STATUS.address,
    "T_FruitStationWrite": CONTROL.words,
    "T_FruitStationLot": BY_NAME["lot"].words,
}
"""Words of each array type; named, because two anonymous arrays are two types for a strict compiler."""
STRUCTURES = {
    "ST_FruitStationStatus": (*STATUS.registers, *MORE_STATUS.registers),
    "ST_FruitStationResult": RESULT.registers,
}
"""Registers of each structure, whose `members` they give."""
_PREFIXES = {"result_reasons": "reason_"}


def field_name(register: Register) -> str:
    """Return the member's name in its data type."""
    return register.name.removeprefix("result_")


def bit_fields(register: Register) -> list[tuple[str, int, str]]:
    """Return name, number and meaning of each flag that becomes a member of its own; alarms have only numbers."""
    if register in ALARMS:
        return []
    prefix = _PREFIXES.get(register.name, "")
    return [(prefix + bit.name, bit.number, bit.meaning) for bit in register.bits]


def members(registers: tuple[Register, ...]) -> Iterator[tuple[str, str, str]]:
    """Return name, type and comment of each member, without floats: the hundredths hold the same value."""
    for register in registers:
        comment = meaning_and_unit(register).replace("²", "2")
        name = field_name(register)
        if register.kind is Kind.U64:
            yield f"{name}_high", "UDINT", f"{comment}, upper half"
            yield f"{name}_low", "UDINT", f"{comment}, lower half"
        elif register.kind in _NUMBERS:
            yield name, NAMES[register.kind].iec, comment
        for flag, _, meaning in bit_fields(register):
            yield flag, "BOOL", meaning


TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,  # noqa: S701 (no HTML)
)


def data_types() -> str:
    """The file with the data types of status and result, and of the words read and written."""
    parts = [_head("Data types")]
    for name, registers in STRUCTURES.items():
        rows = [f"    {member} : {kind}; (* {comment} *)" for member, kind, comment in members(registers)]
        parts.append("\n".join([f"TYPE {name} :", "STRUCT", *rows, "END_STRUCT;", "END_TYPE", ""]))
    for name, words in ARRAYS.items():
        parts.append(f"TYPE {name} : ARRAY[0..{words - 1}] OF WORD; END_TYPE\n")
    return "\n".join(parts)


def function_block() -> str:
    """The file with the function block."""
    return _render("fb_fruit_station.st.j2", "Function block")


def example() -> str:
    """The file with the example program."""
    return _render("example.st.j2", "Example program")


def configuration() -> str:
    """The file with a configuration that runs the example program."""
    return _render("configuration.st.j2", "Configuration")


def _head(what: str) -> str:
    return (
        f"(* {what} for the fruit-inspection station, register map version {MAP_VERSION}, "
        f"checksum 16#{map_checksum():08X}.\n   {MADE_BY} {UNTESTED} *)\n"
    )


def _render(template: str, what: str) -> str:
    return TEMPLATES.get_template(template).render(
        head=_head(what),
        first=STATUS.address,
        last=MORE_STATUS.end - 1,
        writes=CONTROL.words,
        lot_words=BY_NAME["lot"].words,
        control_bits=BY_NAME["control"].bits,
        change_recipe=BY_NAME["command_code"].code("change_recipe"),
        outcome_pass=BY_NAME["result_outcome"].code("PASS"),
        write_key=WRITE_KEY,
        decoding=list(_decoding()),
        at=lambda name: BY_NAME[name].address - STATUS.address,
        to=lambda name: BY_NAME[name].address - CONTROL.address,
    )


def _decoding() -> Iterator[str]:
    for group, variable in ((STATUS, "status"), (RESULT, "seen"), (MORE_STATUS, "status")):
        for register in group.registers:
            yield from _decode(register, variable)


def _decode(register: Register, variable: str) -> Iterator[str]:
    """Return statements that fill the members of one register."""
    target, place = f"{variable}.{field_name(register)}", register.address - STATUS.address
    match register.kind:
        case Kind.U16 | Kind.I16:
            yield f"{target} := WORD_TO_{NAMES[register.kind].iec}(station[{place}]);"
        case Kind.BITS:
            yield f"{target} := station[{place}];"
        case Kind.U32 | Kind.I32:
            yield f"words := {_join(f'{place} + one', f'{place + 1} - one')};"
            yield f"{target} := DWORD_TO_{NAMES[register.kind].iec}(words);"
        case Kind.BITS32:
            yield f"{target} := {_join(f'{place} + one', f'{place + 1} - one')};"
        case Kind.U64:
            yield f"words := {_join(f'{place} + three', f'{place + 1} + one')};"
            yield f"{target}_high := DWORD_TO_UDINT(words);"
            yield f"words := {_join(f'{place + 2} - one', f'{place + 3} - three')};"
            yield f"{target}_low := DWORD_TO_UDINT(words);"
        case _:
            return
    digits = 4 * register.words
    for flag, number, _ in bit_fields(register):
        yield f"{variable}.{flag} := ({target} AND 16#{1 << number:0{digits}X}) <> 16#{0:0{digits}X};"


def _join(high: str, low: str) -> str:
    """Return two registers as one DWORD; `one` and `three` are 0 if the high word comes first."""
    return f"SHL(WORD_TO_DWORD(station[{high}]), 16) OR WORD_TO_DWORD(station[{low}])"
