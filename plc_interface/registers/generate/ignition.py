"""Ignition's tags as JSON: one folder for each block.

Ignition's documentation, "Modbus Addressing": one-based addresses; HR signed and HRUS unsigned 16-bit, HRI and HRUI
32-bit, HRUI_64 unsigned 64-bit, HRF float, HRS text with its length in characters. Tags only read: the PLC writes. The
driver's option "Span Gaps", on by default, joins tags with the addresses between them in one read, which the station
refuses as a whole where the map has gaps.
"""

import json
from typing import Any

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.type_names import NAMES
from plc_interface.registers.map import GROUPS
from plc_interface.registers.register import Kind, Register

DEVICE = "FruitStation"


def ignition() -> str:
    """The file `ignition-tags.json`."""
    folders = [
        {"name": group.name, "tagType": "Folder", "tags": [_tag(register) for register in group.registers]}
        for group in GROUPS
    ]
    root = {
        "name": DEVICE,
        "tagType": "Folder",
        "documentation": f"{MADE_BY} {UNTESTED} The device has one-based addressing, not the reverse word order, "
        "and Span Gaps off: the station refuses a read across the map's gaps.",
        "tags": folders,
    }
    return json.dumps(root, indent=1, ensure_ascii=False) + "\n"


def _tag(register: Register) -> dict[str, Any]:
    designator, data_type = NAMES[register.kind].ignition
    length = f":{2 * register.words}" if register.kind is Kind.TEXT else ""
    return {
        "name": register.name,
        "tagType": "AtomicTag",
        "valueSource": "opc",
        "opcServer": "Ignition OPC UA Server",
        "opcItemPath": f"ns=1;s=[{DEVICE}]{designator}{register.address + 1}{length}",
        "dataType": data_type,
        "readOnly": True,
        "engUnit": register.unit,
        "documentation": register.meaning,
    }
