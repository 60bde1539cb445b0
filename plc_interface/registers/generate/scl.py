"""S7-1500: the function block in SCL, with the Modbus client's calls, as one external source.

The logic is that of the Structured Text, in the form of Siemens' "SCL for S7-1200/S7-1500": locals begin with `#`,
names of types are in quotes, parameters of `SHL` and `SHR` have names, the timer is `TON_TIME`.
"""

import re

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.st_source import Variable, parts
from plc_interface.registers.generate.structured_text import ARRAYS, STRUCTURES, TEMPLATES, function_block, members
from plc_interface.registers.map import GROUP_BY_NAME

_WORDS = re.compile(r"\(\*.*?\*\)|[A-Za-z_][\w#]*(?:\.\w+)*|\d[\w#]*|.", re.DOTALL)
"""Comments, names with their members, numbers, and single characters."""
_SHIFT = re.compile(r"(SH[LR])\(((?:[^()]|\([^()]*\))*), 16\)")
_TIMER = "{InstructionName := 'TON_TIME'; LibVersion := '1.0'} : TON_TIME"


def s7_1500() -> str:
    """The file `s7-1500.scl`."""
    source = parts(function_block())
    sections = {
        section: [_declaration(each) for each in source.variables if each.section == section]
        for section in ("VAR_INPUT", "VAR_OUTPUT", "VAR", "VAR CONSTANT")
    }
    return TEMPLATES.get_template("s7_1500.scl.j2").render(
        made_by=f"{MADE_BY} {UNTESTED}",
        types=_types(),
        sections=sections,
        body=_body(source.body, {each.name for each in source.variables}),
        first=GROUP_BY_NAME["status"].address,
        reads=ARRAYS["T_FruitStationRead"],
        writes=ARRAYS["T_FruitStationWrite"],
        lot_words=ARRAYS["T_FruitStationLot"],
    )


def _types() -> list[str]:
    types = []
    for name, registers in STRUCTURES.items():
        rows = [f"      {member} : {kind};   // {comment}" for member, kind, comment in members(registers)]
        types.append(
            "\n".join([f'TYPE "{name}"', "VERSION : 0.1", "   STRUCT", *rows, "   END_STRUCT;", "END_TYPE", ""])
        )
    return types


def _declaration(variable: Variable) -> str:
    kind = f" : {variable.kind}"
    if variable.kind in ARRAYS:
        kind = f" : Array[0..{ARRAYS[variable.kind] - 1}] of Word"
    elif variable.kind == "TON":
        kind = f" {_TIMER}"
    elif variable.kind.startswith("ST_"):
        kind = f' : "{variable.kind}"'
    initial = f" := {variable.initial}" if variable.initial else ""
    comment = f"   // {variable.comment}" if variable.comment else ""
    return f"{variable.name}{kind}{initial};{comment}"


def _body(body: str, names: set[str]) -> str:
    """The statements with `#` before each local, and names for the parameters of shifts."""
    marked = "".join("#" + word if word.partition(".")[0] in names else word for word in _WORDS.findall(body))
    return _SHIFT.sub(r"\1(IN := \2, N := 16)", marked)
