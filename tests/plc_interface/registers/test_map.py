"""The table: addresses, blocks, numbers taken from the station's own enumerations."""

import dataclasses
import zlib
from itertools import pairwise

import pytest

from plc_interface.registers import map as register_map
from plc_interface.registers.alarms import ALARMS, active_alarms, alarm_values
from plc_interface.registers.codec import encode
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME, GROUPS, REFERENCES, REGISTERS, bit_address, map_checksum
from plc_interface.registers.register import Access, Kind
from station.channel.line import CommandName, PackmlState, Reason, Refusal
from station.inspection.alarm_table import ALARMS as STATION_ALARMS

LARGEST_READ, LARGEST_WRITE, LARGEST_WRITE_OF_FC23 = 125, 123, 121


def test_registers_ascend_and_never_overlap():
    assert all(before.end <= after.address for before, after in pairwise(REGISTERS))
    assert len(BY_NAME) == len(REGISTERS) == len(set(REGISTERS))


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_a_block_has_no_gap_so_that_it_can_be_read_as_one(group):
    assert all(before.end == after.address for before, after in pairwise(group.registers))
    assert group.words <= LARGEST_READ


def test_one_scan_is_one_request():
    status, result, alarms = (GROUP_BY_NAME[name] for name in ("status", "result", "more_status"))
    assert status.address + status.words == result.address
    assert result.address + result.words == alarms.address
    assert status.words + result.words + alarms.words <= LARGEST_READ
    assert GROUP_BY_NAME["control"].words <= min(LARGEST_WRITE, LARGEST_WRITE_OF_FC23)


def test_only_the_control_block_can_be_written():
    written = {register.name for register in REGISTERS if register.access is Access.READ_WRITE}
    assert written == {register.name for register in GROUP_BY_NAME["control"].registers}


def test_the_result_begins_and_ends_with_its_sequence():
    result = GROUP_BY_NAME["result"].registers
    assert (result[0].name, result[-1].name) == ("result_sequence", "result_sequence_end")
    assert result[0].kind is result[-1].kind is Kind.U32


def test_every_alarm_of_the_station_has_its_bit():
    names = [bit.name for register in ALARMS for bit in register.bits]
    assert {f"alarm_{row.number}" for row in STATION_ALARMS.values()} <= set(names)
    every = {row.number for row in STATION_ALARMS.values()}
    values = alarm_values(sum(1 << number - 1 for number in every))
    assert {name for register in ALARMS for name in register.names(values[register.name])} == {
        f"alarm_{number}" for number in every
    }
    assert active_alarms(values) == tuple(sorted(every))


@pytest.mark.parametrize("numbers", [(), (1,), (2, 5), (32, 33, 64)])
def test_active_alarms_are_read_as_they_were_published(numbers):
    assert active_alarms(alarm_values(sum(1 << number - 1 for number in numbers))) == numbers


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_numbers_are_aligned_in_their_block_so_that_it_can_be_laid_over_a_structure(group):
    numbers = [register for register in group.registers if register.kind is not Kind.TEXT]
    assert [register.name for register in numbers if (register.address - group.address) % register.words] == []


def test_flags_and_codes_are_numbered_as_the_stations_enumerations():
    assert [bit.name for bit in BY_NAME["result_reasons"].bits] == list(Reason)
    assert [code.name for code in BY_NAME["last_refusal"].codes.values()] == ["none", *Refusal]
    assert [code.name for code in BY_NAME["command_code"].codes.values()] == ["none", *CommandName]
    assert [code.name for code in BY_NAME["packml_state"].codes.values()] == ["unknown", *PackmlState]
    assert list(BY_NAME["last_refusal"].codes) == list(range(len(Refusal) + 1))


@pytest.mark.parametrize("register", REGISTERS, ids=lambda register: register.name)
def test_a_register_is_complete_and_in_its_bounds(register):
    assert register.meaning
    assert all(bit.number == place for place, bit in enumerate(register.bits))
    assert len({bit.name for bit in register.bits}) == len(register.bits)
    assert register.mask < 1 << (16 * register.words)
    if register.kind in {Kind.BITS, Kind.BITS32}:
        assert register.bits
    elif register.kind is not Kind.TEXT:
        assert len(encode(register, register.low)) == len(encode(register, register.high)) == register.words
    for value in register.codes:
        assert register.low <= value <= register.high


def test_every_reference_has_its_register():
    assert {register.name for register in REGISTERS if register.name.startswith("reference_")} == set(REFERENCES)


def test_a_flag_is_a_coil_too():
    assert bit_address(BY_NAME["control"], 1) == 1
    assert bit_address(BY_NAME["status"], 15) == 1615


def test_the_checksum_is_the_tables_and_not_the_wordings(monkeypatch):
    first = map_checksum()
    assert first == zlib.crc32(register_map.canonical_table().encode())
    reworded = tuple(dataclasses.replace(register, meaning="other words") for register in REGISTERS)
    monkeypatch.setattr(register_map, "REGISTERS", reworded)
    assert map_checksum() == first
    moved = (*REGISTERS[:-1], dataclasses.replace(REGISTERS[-1], address=REGISTERS[-1].address + 2))
    monkeypatch.setattr(register_map, "REGISTERS", moved)
    assert map_checksum() != first
