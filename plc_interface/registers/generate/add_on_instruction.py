"""Logix: the function block as an Add-On Instruction, with the logic in Rockwell's Structured Text.

The logic is that of the Structured Text, in the form of Rockwell's "Logix 5000 Controllers Structured Text"
(1756-PM007) and "Logix 5000 Controllers Import/Export" (1756-RM084): numbers are DINT, a 16-bit word is made
unsigned by a mask, a structure or a word is copied by COP, and the timer is TONR. COP copies the low word first, so the
station's `modbus.word_order` has to be `low_first`. A Logix controller retains all tags over PROG; its prescan,
which precedes the first scan, runs the routine `Prescan`.
"""

import re
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from plc_interface.registers.generate.st_source import Variable, parts
from plc_interface.registers.generate.structured_text import ARRAYS, STRUCTURES, function_block, members
from plc_interface.registers.generate.structures import document, logix_root

NAME = "FB_FruitStation"
_DIRECTION = {"VAR_INPUT": "Input", "VAR_OUTPUT": "Output"}
_LEFT_OUT = {"low_word_first", "one", "three"}
"""Of the choice of the word order."""
_FORGOTTEN = ("alive", "heartbeat_known", "phase", "done", "passed", "may_move", "acknowledging")
"""By the prescan: another fruit may be in place than before the stop."""
_CALLS = re.compile(r"\b(?:[A-Z]+_TO_[A-Z]+)\(((?:[^()]|\([^()]*\))*)\)")


def add_on_instruction() -> str:
    """The file `add-on-instruction.L5X`."""
    source = parts(function_block())
    root, controller = logix_root(NAME, "AddOnInstructionDefinition")
    _data_types(ET.SubElement(controller, "DataTypes", Use="Context"))
    definitions = ET.SubElement(controller, "AddOnInstructionDefinitions", Use="Context")
    definition = ET.SubElement(
        definitions, "AddOnInstructionDefinition",
        Use="Target", Name=NAME, Revision="1.0", ExecutePrescan="true", ExecutePostscan="false",
        ExecuteEnableInFalse="false", CreatedDate="2026-01-01T00:00:00.000Z", CreatedBy="",
        EditedDate="2026-01-01T00:00:00.000Z", EditedBy="", SoftwareRevision="v32.00",
    )  # fmt: skip
    ET.SubElement(definition, "Description").text = (
        "One inspection at a time. A fruit may go on only where done AND passed; what moves it may run only where "
        "may_move. "
        "Set the station's modbus.word_order to low_first."
    )
    variables = [each for each in source.variables if each.name not in _LEFT_OUT]
    constants = {each.name: each.initial for each in variables if each.section == "VAR CONSTANT"}
    parameters = ET.SubElement(definition, "Parameters")
    for name, usage in (("EnableIn", "Input"), ("EnableOut", "Output")):
        ET.SubElement(
            parameters, "Parameter", Name=name, TagType="Base", DataType="BOOL", Usage=usage, Radix="Decimal",
            Required="false", Visible="false", ExternalAccess="Read Only",
        )  # fmt: skip
    for each in variables:
        if each.section in _DIRECTION:
            _parameter(parameters, each)
    local = ET.SubElement(definition, "LocalTags")
    for each in variables:
        if each.section == "VAR":
            kind = _kind(each)
            radix = {} if kind == "FBD_TIMER" or kind.startswith("ST_") else {"Radix": "Decimal"}
            ET.SubElement(local, "LocalTag", {"Name": each.name, "DataType": kind, **radix, "ExternalAccess": "None"})
    routines = ET.SubElement(definition, "Routines")
    _routine(routines, "Logic", _logic(source.body, variables, constants).splitlines())
    _routine(routines, "Prescan", [f"{name} := 0;" for name in _FORGOTTEN])
    return document(root)


def _routine(routines: ET.Element, name: str, lines: Iterable[str]) -> None:
    content = ET.SubElement(ET.SubElement(routines, "Routine", Name=name, Type="ST"), "STContent")
    for number, line in enumerate(lines):
        ET.SubElement(content, "Line", Number=str(number)).text = line


def _kind(variable: Variable) -> str:
    if variable.kind in ARRAYS:
        return "INT"
    if variable.kind == "TON":
        return "FBD_TIMER"
    return variable.kind if variable.kind == "BOOL" or variable.kind.startswith("ST_") else "DINT"


def _parameter(parameters: ET.Element, variable: Variable) -> None:
    kind, usage = _kind(variable), _DIRECTION[variable.section]
    shape: dict[str, str] = {}
    if variable.kind in ARRAYS:
        shape, usage = {"Dimensions": str(ARRAYS[variable.kind]), "Radix": "Decimal"}, "InOut"
    elif kind.startswith("ST_"):
        usage = "InOut"
    else:
        shape = {"Radix": "Decimal"}
    must = {"Required": str(usage == "InOut").lower(), "Visible": "true"}
    access = {} if usage == "InOut" else {"ExternalAccess": "Read Only" if usage == "Output" else "Read/Write"}
    made = ET.SubElement(
        parameters,
        "Parameter",
        {"Name": variable.name, "TagType": "Base", "DataType": kind, "Usage": usage, **shape, **must, **access},
    )
    if variable.comment:
        ET.SubElement(made, "Description").text = variable.comment
    if variable.initial:
        data = ET.SubElement(made, "DefaultData", Format="Decorated")
        ET.SubElement(data, "DataValue", DataType=kind, Radix="Decimal", Value=str(_milliseconds(variable.initial)))


def _milliseconds(literal: str) -> int:
    return 1000 * int(literal.removeprefix("T#").removesuffix("s"))


def _data_types(types: ET.Element) -> None:
    """The structures; Logix stores eight flags in a hidden byte."""
    for name, registers in STRUCTURES.items():
        made = ET.SubElement(types, "DataType", Name=name, Family="NoFamily", Class="User")
        listed, flags = ET.SubElement(made, "Members"), 0
        for member, kind, comment in members(registers):
            row = {"Name": member, "DataType": "DINT", "Dimension": "0", "Radix": "Decimal", "Hidden": "false"}
            if kind == "BOOL":
                host = f"ZZZZZZZZZZ{name[3:21]}{flags // 8}"
                if flags % 8 == 0:
                    hidden = {"Name": host, "DataType": "SINT", "Hidden": "true", "ExternalAccess": "Read/Write"}
                    ET.SubElement(listed, "Member", {**row, **hidden})
                row |= {"DataType": "BIT", "Target": host, "BitNumber": str(flags % 8)}
                flags += 1
            ET.SubElement(
                ET.SubElement(listed, "Member", {**row, "ExternalAccess": "Read/Write"}), "Description"
            ).text = comment


def _logic(body: str, variables: list[Variable], constants: dict[str, str]) -> str:
    structures = {each.name for each in variables if each.kind.startswith("ST_")}
    # The word order is fixed: what chooses it goes, and so do its offsets
    body = re.sub(r"IF low_word_first THEN\n.*?END_IF;\n", "", body, flags=re.DOTALL)
    body = re.sub(r"\[(\d+) ([+-]) (one|three)\]", _swapped, body)
    body = re.sub(r"SHL\(WORD_TO_DWORD\(station\[(\d+)\]\), 16\)", r"(station[\1] * 65536)", body)
    body = re.sub(r"WORD_TO_INT\(station\[(\d+)\]\)", r"station[\1 ]", body)  # signed as it is, past the next line
    body = re.sub(r"(?<!\()station\[(\d+)\](?! \*)|\bstation\[(\d+)\](?! \*)", _unsigned, body)
    body = re.sub(
        r"    words := UDINT_TO_DWORD\((\w+)\);\n    registers\[(\d+)\] := .*\n    registers\[(\d+)\] := .*\n",
        r"    COP(\1, registers[\3], 2);\n",
        body,
    )
    body = re.sub(r"registers\[(\d+)\] := UINT_TO_WORD\((\w+)\);", r"COP(\2, registers[\1], 1);", body)
    while _CALLS.search(body):
        body = _CALLS.sub(r"\1", body)
    body = re.sub(r"(\w+)\(IN := (.+), PT := (\w+)\);", _timer, body)
    body = re.sub(r"(\w+_timer)\.Q\b", r"\1.DN", body)
    body = re.sub(r"\b(\w+) := (\w+);", lambda m: f"COP({m[2]}, {m[1]}, 1);" if m[1] in structures else m[0], body)
    body = body.replace(" ];", "];")
    for name, value in {**constants, "TRUE": "1", "FALSE": "0"}.items():
        body = re.sub(rf"\b{name}\b", value, body)
    return body


def _swapped(found: re.Match[str]) -> str:
    """The place of a word where the low word comes first."""
    by = {"one": 1, "three": 3}[found[3]] * (1 if found[2] == "+" else -1)
    return f"[{int(found[1]) + by}]"


def _unsigned(found: re.Match[str]) -> str:
    return f"(station[{found[1] or found[2]}] AND 16#0000FFFF)"


def _timer(found: re.Match[str]) -> str:
    name, starts, lasts = found.groups()
    return f"{name}.TimerEnable := ({starts}); {name}.PRE := {lasts}; TONR({name});"
