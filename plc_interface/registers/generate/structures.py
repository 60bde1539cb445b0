"""Structures in memory order for little-endian controllers: Studio 5000 (L5X) and CODESYS (PLCopen XML).

Words that such a controller has read can be copied onto the structure if the station is configured for the low word
first, because its numbers are aligned in each block. Texts then have their characters swapped in pairs.
"""

from xml.etree import ElementTree as ET

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.type_names import NAMES, flags, meaning_and_unit
from plc_interface.registers.map import GROUPS
from plc_interface.registers.register import Kind, Register

LOW_FIRST = "Set the station to the low word first, read the block's registers and copy them onto it byte by byte."
PLCOPEN = "http://www.plcopen.org/xml/tc6_0200"
XHTML = "http://www.w3.org/1999/xhtml"
_WHEN = "2026-01-01T00:00:00"
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
    """The file `codesys-plcopen.xml`: a data type for each block."""
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
    ET.SubElement(types, _tag("pous"))
    for group in GROUPS:
        data_type = ET.SubElement(listed, _tag("dataType"), name=f"FruitStation_{group.name}")
        structure = ET.SubElement(ET.SubElement(data_type, _tag("baseType")), _tag("struct"))
        for register in group.registers:
            variable = ET.SubElement(structure, _tag("variable"), name=register.name)
            kind = ET.SubElement(variable, _tag("type"))
            if register.kind is Kind.TEXT:
                array = ET.SubElement(kind, _tag("array"))
                ET.SubElement(array, _tag("dimension"), lower="0", upper=str(register.words - 1))
                kind = ET.SubElement(array, _tag("baseType"))
            ET.SubElement(kind, _tag(NAMES[register.kind].iec))
            _documentation(variable, _comment(register))
        _documentation(data_type, f"{group.title}: registers {group.address} to {group.end - 1}. {LOW_FIRST}")
    ET.SubElement(ET.SubElement(root, _tag("instances")), _tag("configurations"))
    return document(root)


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
