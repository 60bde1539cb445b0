"""Structures in memory order for little-endian controllers: Studio 5000 (L5X) and CODESYS (PLCopen XML).

The PLCopen XML has the function block, too.

Words that such a controller has read can be copied onto the structure if the station is configured for the low word
first, because its numbers are aligned in each block. Texts then have their characters swapped in pairs.
"""

from xml.etree import ElementTree as ET

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.st_source import parts
from plc_interface.registers.generate.structured_text import ARRAYS, STRUCTURES, function_block, members
from plc_interface.registers.generate.type_names import NAMES, flags, meaning_and_unit
from plc_interface.registers.map import GROUPS
from plc_interface.registers.register import Kind, Register

LOW_FIRST = "Set the station to the low word first, read the block's registers and copy them onto it byte by byte."
PLCOPEN = "http://www.plcopen.org/xml/tc6_0200"
XHTML = "http://www.w3.org/1999/xhtml"
_WHEN = "2026-01-01T00:00:00"
_SECTIONS = {"VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR": "localVars", "VAR CONSTANT": "localVars"}
_DERIVED = ("T_", "ST_", "TON")
"""How the names of types begin that PLCopen XML has no element for."""
"""The schema requires a time; a fixed one, so that the file changes only with the map."""


def studio_5000() -> str:
    """The file `studio-5000.L5X`: a data type for each block and one that holds them all."""
    root, controller = logix_root("FruitStation", "DataType")
    types = ET.SubElement(controller, "DataTypes", Use="Context")
    for group in GROUPS:
        listed = _logix_type(types, f"FruitStation_{group.name}", f"{group.title}. {LOW_FIRST}")
        for register in group.registers:
            dimension = register.words if register.kind is Kind.TEXT else 0
            _logix_member(listed, register.name, NAMES[register.kind].logix, dimension, _comment(register))
    whole = _logix_type(types, "FruitStation", "The fruit-inspection station's registers", Use="Target")
    for group in GROUPS:
        about = f"Registers {group.address} to {group.end - 1}"
        _logix_member(whole, group.name, f"FruitStation_{group.name}", 0, about)
    return document(root)


def codesys() -> str:
    """The file `codesys-plcopen.xml`: a data type for each register block, and the function block with its types."""
    ET.register_namespace("", PLCOPEN)
    root = ET.Element(_tag("project"))
    ET.SubElement(
        root, _tag("fileHeader"),
        companyName="", productName="fruit-station", productVersion="1", creationDateTime=_WHEN,
    )  # fmt: skip
    header = ET.SubElement(root, _tag("contentHeader"), name="FruitStation", modificationDateTime=_WHEN)
    coordinates = ET.SubElement(header, _tag("coordinateInfo"))
    for language in ("fbd", "ld", "sfc"):
        ET.SubElement(ET.SubElement(coordinates, _tag(language)), _tag("scaling"), x="1", y="1")
    types = ET.SubElement(root, _tag("types"))
    listed = ET.SubElement(types, _tag("dataTypes"))
    for group in GROUPS:
        data_type = ET.SubElement(listed, _tag("dataType"), name=f"FruitStation_{group.name}")
        structure = ET.SubElement(ET.SubElement(data_type, _tag("baseType")), _tag("struct"))
        for register in group.registers:
            words = register.words if register.kind is Kind.TEXT else 0
            _variable(structure, register.name, NAMES[register.kind].iec, _comment(register), words=words)
        _documentation(data_type, f"{group.title}: registers {group.address} to {group.end - 1}. {LOW_FIRST}")
    for name, registers in STRUCTURES.items():
        base = ET.SubElement(ET.SubElement(listed, _tag("dataType"), name=name), _tag("baseType"))
        structure = ET.SubElement(base, _tag("struct"))
        for member, kind, comment in members(registers):
            _variable(structure, member, kind, comment)
    for name, words in ARRAYS.items():
        _type(ET.SubElement(ET.SubElement(listed, _tag("dataType"), name=name), _tag("baseType")), "WORD", words)
    _plcopen_block(ET.SubElement(types, _tag("pous")))
    ET.SubElement(ET.SubElement(root, _tag("instances")), _tag("configurations"))
    return document(root)


def _plcopen_block(pous: ET.Element) -> None:
    """The Structured Text's function block: its declarations as elements, its statements word for word."""
    source = parts(function_block())
    pou = ET.SubElement(pous, _tag("pou"), name="FB_FruitStation", pouType="functionBlock")
    interface = ET.SubElement(pou, _tag("interface"))
    for section, name in _SECTIONS.items():
        constant = {"constant": "true"} if section == "VAR CONSTANT" else {}
        variables = ET.SubElement(interface, _tag(name), constant)
        for each in source.variables:
            if each.section == section:
                _variable(variables, each.name, each.kind, each.comment, initial=each.initial)
    text = ET.SubElement(ET.SubElement(pou, _tag("body")), _tag("ST"))
    ET.SubElement(text, f"{{{XHTML}}}xhtml").text = source.body
    _documentation(pou, source.comment)


def _variable(parent: ET.Element, name: str, kind: str, comment: str, *, words: int = 0, initial: str = "") -> None:
    variable = ET.SubElement(parent, _tag("variable"), name=name)
    _type(ET.SubElement(variable, _tag("type")), kind, words)
    if initial:
        ET.SubElement(ET.SubElement(variable, _tag("initialValue")), _tag("simpleValue"), value=initial)
    if comment:
        _documentation(variable, comment)


def _type(parent: ET.Element, kind: str, words: int) -> None:
    """Add a type: of a variable, or of an array's elements where it has words."""
    if words:
        array = ET.SubElement(parent, _tag("array"))
        ET.SubElement(array, _tag("dimension"), lower="0", upper=str(words - 1))
        parent = ET.SubElement(array, _tag("baseType"))
    if kind.startswith(_DERIVED):
        ET.SubElement(parent, _tag("derived"), name=kind)
    else:
        ET.SubElement(parent, _tag(kind))


def logix_root(name: str, kind: str) -> tuple[ET.Element, ET.Element]:
    """Return the root of an L5X file that holds one target of a type, and its controller."""
    root = ET.Element(
        "RSLogix5000Content",
        SchemaRevision="1.0",
        SoftwareRevision="32.00",
        TargetName=name,
        TargetType=kind,
        ContainsContext="true",
        ExportOptions="References NoRawData L5KData DecoratedData Context Dependencies",
    )
    return root, ET.SubElement(root, "Controller", Use="Context", Name="Controller")


def _logix_type(types: ET.Element, name: str, description: str, **attributes: str) -> ET.Element:
    data_type = ET.SubElement(types, "DataType", attributes, Name=name, Family="NoFamily", Class="User")
    ET.SubElement(data_type, "Description").text = description
    return ET.SubElement(data_type, "Members")


def _logix_member(members: ET.Element, name: str, data_type: str, dimension: int, description: str) -> None:
    radix = "NullType" if data_type.startswith("FruitStation") else "Float" if data_type == "REAL" else "Decimal"
    member = ET.SubElement(
        members, "Member", Name=name, DataType=data_type, Dimension=str(dimension), Radix=radix, Hidden="false",
        ExternalAccess="Read/Write",
    )  # fmt: skip
    ET.SubElement(member, "Description").text = description


def _documentation(parent: ET.Element, text: str) -> None:
    ET.SubElement(ET.SubElement(parent, _tag("documentation")), f"{{{XHTML}}}p").text = text


def _comment(register: Register) -> str:
    bits = flags(register)
    return meaning_and_unit(register) + (f"; bits: {bits}" if bits else "")


def _tag(name: str) -> str:
    return f"{{{PLCOPEN}}}{name}"


def document(root: ET.Element) -> str:
    """Return an XML file, with the notices that it is generated and untested."""
    ET.indent(root)
    body = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {MADE_BY.replace("`", "")} {UNTESTED} -->\n{body}\n'
