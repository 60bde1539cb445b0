"""Every register is in every import file, at its offset, with its type."""

import csv
import io
import json
import re
import tomllib
from xml.etree import ElementTree as ET

import pytest

from plc_interface.registers.alarms import ALARMS
from plc_interface.registers.generate.add_on_instruction import add_on_instruction
from plc_interface.registers.generate.ignition import ignition
from plc_interface.registers.generate.reference import markdown, table
from plc_interface.registers.generate.scl import s7_1500
from plc_interface.registers.generate.st_source import Variable, parts
from plc_interface.registers.generate.structured_text import ARRAYS, STRUCTURES, function_block, members
from plc_interface.registers.generate.structures import PLCOPEN, codesys, studio_5000
from plc_interface.registers.generate.telegraf import telegraf
from plc_interface.registers.generate.tia import tia
from plc_interface.registers.map import BY_NAME, GROUPS, REGISTERS, map_checksum
from plc_interface.registers.register import Kind

SIGNED = {Kind.I16, Kind.I32}


def test_the_csv_holds_every_register():
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(table()))}
    assert list(rows) == [register.name for register in REGISTERS]
    for register in REGISTERS:
        row = rows[register.name]
        assert int(row["pdu_address"]) == int(row["hexadecimal"], 16) == register.address
        assert int(row["reference_4x"]) - 400_001 == int(row["reference_3x"]) - 300_001 == register.address
        assert (row["type"], int(row["words"]), row["meaning"]) == (register.kind, register.words, register.meaning)
        assert row["bits"].count(":") == len(register.bits)
        assert row["codes"].count(":") == len(register.codes)
    assert rows["result_area_mm2_x100"]["invalid"] == str(-(2**31))


def test_the_document_names_every_register_bit_and_code():
    text = markdown()
    assert f"0x{map_checksum():08X}" in text
    for register in REGISTERS:
        assert f"| {register.address} | {400_001 + register.address} | `{register.name}`" in text
        named = [bit.name for bit in register.bits if register not in ALARMS]
        assert all(f"`{name}`" in text for name in (register.name, *named))
        assert all(f"`{code.name}`" in text for code in register.codes.values())
    assert len({line.count("|") for line in text.splitlines() if line.startswith("| 1")}) <= 4


def test_telegraf_reads_every_block_but_the_control_block():
    whole = tomllib.loads(telegraf())
    (plugin,) = whole["inputs"]["modbus"]
    fields = {field["name"]: field for request in plugin["request"] for field in request["fields"]}
    assert set(fields) == {register.name for group in GROUPS[1:] for register in group.registers}
    widths = {"16": 1, "32": 2, "64": 4}
    for name, field in fields.items():
        register = BY_NAME[name]
        assert field["address"] == register.address
        if register.kind is Kind.TEXT:
            assert (field["type"], field["length"]) == ("STRING", register.words)
            continue
        assert widths[field["type"][-2:]] == register.words
        assert field["type"].startswith("INT") == (register.kind in SIGNED)
        assert field["type"].startswith("FLOAT") == (register.kind is Kind.F32)
    assert {request["byte_order"] for request in plugin["request"]} == {"ABCD"}
    (strings,) = whole["processors"]["strings"]
    texts = {name for name in fields if BY_NAME[name].kind is Kind.TEXT}
    assert {trim["field"] for trim in strings["trim_right"] if trim["cutset"] == "\0"} == texts != set()


def test_ignition_reads_every_register():
    root = json.loads(ignition())
    tags = {tag["name"]: tag for folder in root["tags"] for tag in folder["tags"]}
    assert set(tags) == set(BY_NAME)
    assert "one-based addressing, not the reverse word order, and Span Gaps off" in root["documentation"]
    assert all(tag["readOnly"] for tag in tags.values())
    widths = {"HR": 1, "HRUS": 1, "HRI": 2, "HRUI": 2, "HRF": 2, "HRUI_64": 4}
    for name, tag in tags.items():
        register = BY_NAME[name]
        found = re.fullmatch(r"ns=1;s=\[FruitStation\](HR(?:UI_64|[A-Z]*))(\d+)(?::(\d+))?", tag["opcItemPath"])
        assert found
        designator, one_based, characters = found.groups()
        assert int(one_based) == register.address + 1
        if register.kind is Kind.TEXT:
            assert (designator, int(characters)) == ("HRS", 2 * register.words)
            continue
        assert widths[designator] == register.words
        assert (designator in {"HR", "HRI"}) == (register.kind in SIGNED)
        assert (designator == "HRF") == (register.kind is Kind.F32)


S7_BYTES = {"Word": 2, "UInt": 2, "Int": 2, "DWord": 4, "UDInt": 4, "DInt": 4, "Real": 4}


def test_tias_data_types_lie_as_the_registers_do():
    text = tia()
    types = re.findall(r'TYPE "FruitStation_(\w+)"\n.*?STRUCT\n(.*?)\n   END_STRUCT;\nEND_TYPE', text, re.DOTALL)
    assert [name for name, _ in types] == [group.name for group in GROUPS]
    assert text.count("S7_Optimized_Access := 'FALSE'") == len(GROUPS)
    for (_, body), group in zip(types, GROUPS, strict=True):
        offsets, at = {}, 0
        for line in body.splitlines():
            found = re.fullmatch(r' +"(\w+)" : (?:(\w+)|Array\[0\.\.(\d+)\] of Char);   // .+', line)
            assert found, line
            name, kind, last = found.groups()
            assert at % 2 == 0
            offsets[name] = at
            at += S7_BYTES[kind] if kind else int(last) + 1
        expected = {}
        for register in group.registers:
            at_byte = 2 * (register.address - group.address)
            halves = ("_high", "_low") if register.kind is Kind.U64 else ("",)
            expected |= {register.name + half: at_byte + 4 * number for number, half in enumerate(halves)}
        assert offsets == expected
        assert at == 2 * group.words


C_BYTES = {"INT": 2, "UINT": 2, "WORD": 2, "DINT": 4, "UDINT": 4, "DWORD": 4, "REAL": 4, "LINT": 8, "ULINT": 8}


def laid_out(members: list[tuple[str, str, int]]) -> tuple[dict[str, int], int]:
    """Offsets of a structure whose numbers are aligned to their size, as both tools do it, and its end."""
    offsets, at = {}, 0
    for name, kind, count in members:
        size = C_BYTES[kind]
        at += -at % size
        offsets[name] = at
        at += size * count
    return offsets, at


def inside(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path, {"p": PLCOPEN})
    assert found is not None, path
    return found


def l5x_members(name: str) -> list[tuple[str, str, int]]:
    root = ET.fromstring(studio_5000().encode())
    assert root.get("TargetName") == "FruitStation"
    data_type = inside(root, f".//DataType[@Name='FruitStation_{name}']")
    return [(m.attrib["Name"], m.attrib["DataType"], int(m.attrib["Dimension"]) or 1) for m in data_type.iter("Member")]


def plcopen_type(element: ET.Element) -> tuple[str, int]:
    """Name and number of elements."""
    (kind,) = element
    count = 1
    if kind.tag.endswith("array"):
        count = int(inside(kind, "p:dimension").attrib["upper"]) + 1
        (kind,) = inside(kind, "p:baseType")
    return kind.get("name") or kind.tag.rpartition("}")[2], count


def plcopen_structure(name: str) -> list[tuple[str, str, int]]:
    data_type = inside(ET.fromstring(codesys().encode()), f".//p:dataType[@name='{name}']")
    structure = inside(data_type, "p:baseType/p:struct")
    return [(variable.attrib["name"], *plcopen_type(inside(variable, "p:type"))) for variable in structure]


def plcopen_members(name: str) -> list[tuple[str, str, int]]:
    return plcopen_structure(f"FruitStation_{name}")


@pytest.mark.parametrize("members_of", [l5x_members, plcopen_members])
@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_structures_lie_as_the_registers_do(members_of, group):
    members = members_of(group.name)
    offsets, end = laid_out(members)
    assert offsets == {register.name: 2 * (register.address - group.address) for register in group.registers}
    assert end == 2 * group.words
    for name, kind, _ in members:
        register = BY_NAME[name]
        assert (kind == "REAL") == (register.kind is Kind.F32)
        if register.kind in SIGNED:
            assert kind in {"INT", "DINT"}


def plcopen_variable(section: str, element: ET.Element) -> Variable:
    kind, count = plcopen_type(inside(element, "p:type"))
    assert count == 1, "the block's arrays have named types"
    initial = element.find("p:initialValue/p:simpleValue", {"p": PLCOPEN})
    comment = "".join(text for part in element.findall("p:documentation", {"p": PLCOPEN}) for text in part.itertext())
    return Variable(
        section, element.attrib["name"], kind, "" if initial is None else initial.attrib["value"], comment.strip()
    )


def test_the_plcopen_block_is_the_structured_texts():
    root, source = ET.fromstring(codesys().encode()), parts(function_block())
    pou = inside(root, ".//p:pous/p:pou[@pouType='functionBlock']")
    assert pou.attrib["name"] == "FB_FruitStation"
    sections = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR"}
    variables = [
        plcopen_variable(sections[part.tag.rpartition("}")[2]] + " CONSTANT" * ("constant" in part.attrib), variable)
        for part in inside(pou, "p:interface")
        for variable in part
    ]
    assert variables == list(source.variables)
    (text,) = inside(pou, "p:body/p:ST")
    assert text.text == source.body
    assert "A fruit may go on only where done AND passed." in "".join(inside(pou, "p:documentation").itertext())


def test_the_plcopen_blocks_types_are_the_structured_texts():
    root = ET.fromstring(codesys().encode())
    for name, registers in STRUCTURES.items():
        assert plcopen_structure(name) == [(member, kind, 1) for member, kind, _ in members(registers)]
    for name, words in ARRAYS.items():
        assert plcopen_type(inside(root, f".//p:dataType[@name='{name}']/p:baseType")) == ("WORD", words)
    derived = {found.attrib["name"] for found in root.iter(f"{{{PLCOPEN}}}derived")}
    assert derived == {*STRUCTURES, *ARRAYS, "TON"}


@pytest.mark.parametrize(
    "text", [telegraf(), ignition(), tia(), studio_5000(), codesys(), s7_1500(), add_on_instruction()]
)
def test_a_file_says_that_it_was_not_tried_in_the_tool(text):
    assert "Untested against the vendor's tool." in text
