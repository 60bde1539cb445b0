"""The nodes' data sheets are read by canopen and define what the driver packs."""

import configparser
from typing import Any

import canopen
import pytest

from plc_interface.outputs.can.link import COUNT, ORDER, REPORT
from station.settings.can import ENCODER_EDS, GATE_EDS

NODE = 0x23


def read(sheet) -> Any:
    return canopen.import_od(str(sheet), NODE)


def mapped(sheet, index):
    """The lengths in bits of what a PDO carries."""
    return [entry.default & 0xFF for subindex, entry in read(sheet)[index].items() if subindex]


@pytest.mark.parametrize(
    ("sheet", "profile", "indices"),
    [
        (GATE_EDS, 401, (0x1016, 0x1017, 0x1018, 0x1029, 0x1400, 0x1401, 0x1800, 0x6200, 0x6206, 0x6207)),
        (ENCODER_EDS, 406, (0x1016, 0x1017, 0x1018, 0x1029, 0x1800, 0x6000, 0x6001, 0x6002, 0x6003, 0x6004, 0x6500)),
    ],
)
def test_a_sheet_has_its_profiles_objects(sheet, profile, indices):
    objects = read(sheet)
    assert objects[0x1000].default & 0xFFFF == profile
    assert all(index in objects for index in indices)
    information = objects.device_information
    assert information.product_number == objects[0x1018][2].default
    assert information.revision_number == objects[0x1018][3].default


@pytest.mark.parametrize("sheet", [GATE_EDS, ENCODER_EDS])
def test_a_sheets_lists_name_every_object_once(sheet):
    parser = configparser.RawConfigParser()
    parser.read(sheet)
    listed = [
        int(parser[section][str(number)], 0)
        for section in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
        for number in range(1, int(parser[section]["SupportedObjects"]) + 1)
    ]
    present = [int(section, 16) for section in parser.sections() if len(section) == 4]
    assert sorted(listed) == sorted(present)
    for index in present:
        if "SubNumber" in parser[f"{index:04X}"]:
            subs = [section for section in parser.sections() if section.startswith(f"{index:04X}sub")]
            assert len(subs) == int(parser[f"{index:04X}"]["SubNumber"])


def test_the_pdos_are_laid_out_as_the_driver_packs_them():
    assert mapped(GATE_EDS, 0x1600) == [16, 8, 8, 32]
    assert mapped(GATE_EDS, 0x1601) == [32]
    assert mapped(GATE_EDS, 0x1A00) == [16, 8, 32]
    assert mapped(ENCODER_EDS, 0x1A00) == [32]
    assert (ORDER.size, REPORT.size, COUNT.size) == (8, 7, 4)
    objects = read(GATE_EDS)
    assert objects[0x1400][1].default == 0x200 + NODE
    assert objects[0x1800][1].default & 0x7FF == 0x180 + NODE
