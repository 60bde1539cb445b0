"""The one register map: server, checks, client, documents and PLC code are made from this table.

Addresses are PDU addresses. A register may be read by function codes 03 and 04 alike. 16-bit flags can also be reached
as coils or discrete inputs, at `bit_address`.
"""

import json
import math
import zlib
from typing import NamedTuple

from plc_interface.registers.bits import (
    ALARM_BITS,
    COMMAND_CODES,
    COMMAND_RESULT_CODES,
    CONTROL_BITS,
    FLAG_BITS,
    MORE_ALARM_BITS,
    MORE_STATUS_BITS,
    OUTCOME_CODES,
    PACKML_MODE_CODES,
    PACKML_STATE_CODES,
    REASON_BITS,
    REFUSAL_CODES,
    STATUS_BITS,
    WRITE_KEY_CODES,
)
from plc_interface.registers.register import Access, Kind, Register
from station.channel.line import CommandName

MAP_VERSION = 1
"""Raised with every change that an integrator has to follow; `map_checksum` changes with any change.

A map that only grows has the same version: no register moves or changes, new ones follow those of their block or are a
block of their own, and a program that neither reads nor writes them works as before. What is added to the result ends
with another copy of the sequence, so that a torn read of it is found as well.
"""

RO, RW = Access.READ_ONLY, Access.READ_WRITE
U16_MAX, U32_MAX, U64_MAX = 2**16 - 1, 2**32 - 1, 2**64 - 1
QUEUE_PLACES = 8


def _u16(name: str, address: int, meaning: str, access: Access = RO, unit: str = "", high: int = U16_MAX) -> Register:
    return Register(name, address, Kind.U16, access, unit, 0, high, meaning)


def _u32(name: str, address: int, meaning: str, access: Access = RO, unit: str = "") -> Register:
    return Register(name, address, Kind.U32, access, unit, 0, U32_MAX, meaning)


CONTROL = (
    Register("control", 0, Kind.BITS, RW, "", None, None, "Requests of the PLC", bits=CONTROL_BITS),
    _u16("trigger_id", 1, "The PLC's number of the fruit to inspect, 1 to 65535, other than the one before", RW),
    _u32("acknowledged_sequence", 2, "The sequence of the published result, once the PLC has taken it", RW),
    Register("command_code", 4, Kind.U16, RW, "", 0, len(CommandName), "Command to execute", codes=COMMAND_CODES),
    _u16("command_argument", 5, "The command's argument", RW),
    _u16("command_sequence", 6, "The PLC's number of the command, echoed with its result", RW),
    _u16("plc_heartbeat", 7, "Changed by the PLC in each scan; the interface disarms if it stops changing after that",
         RW),
    _u32("encoder", 8, "The line's encoder at the trigger, given back with the result", RW, "counts"),
    Register("lot", 10, Kind.TEXT, RW, "", None, None, "The lot's id, taken by latch_lot", text_words=16),
    Register("write_key", 26, Kind.U16, RW, "", 0, U16_MAX, "Claims or releases the write lock", codes=WRITE_KEY_CODES),
    _u16("fruit_length_mm_x10", 27, "Length of the fruit from stem to tip, taken with the trigger and used up by it; "
         "0: not given", RW, "mm/10"),
    _u16("size_class", 28, "The grader's size class of the fruit, taken and used up likewise; 0: not given", RW),
)  # fmt: skip
"""Written by the one writer, read by anybody."""

STATUS = (
    Register("status", 100, Kind.BITS, RO, "", None, None, "State of the station", bits=STATUS_BITS),
    Register("packml_state", 101, Kind.U16, RO, "", 0, 17, "PackML state", codes=PACKML_STATE_CODES),
    Register("packml_mode", 102, Kind.U16, RO, "", 0, 3, "PackML unit mode", codes=PACKML_MODE_CODES),
    _u16("accepted_trigger_id", 103, "The last trigger id accepted, 0 for none"),
    _u16("station_heartbeat", 104, "Changes while the station and this interface are healthy"),
    _u16("plc_heartbeat_echo", 105, "The PLC's heartbeat as last written"),
    _u16("command_sequence_echo", 106, "The sequence of the command that command_result is about"),
    Register("command_result", 107, Kind.U16, RO, "", 0, 6, "Result of the command", codes=COMMAND_RESULT_CODES),
    _u16("active_recipe", 108, "The active recipe's number, 0 for none"),
    _u16("free_places", 109, "Results that can still wait", high=QUEUE_PLACES),
    _u32("active_recipe_checksum", 110, "CRC-32 of the active recipe's canonical JSON, 0 for none"),
    _u16("waiting_results", 112, "Results not acknowledged, including the published one", high=QUEUE_PLACES),
    _u16("error_code", 113, "Number of the active alarm of the highest priority; 0: none; 1000: station lost"),
    Register("alarms", 114, Kind.BITS32, RO, "", None, None, "Active alarms 1 to 32", bits=ALARM_BITS),
    Register("last_refusal", 116, Kind.U16, RO, "", 0, 10, "Reason of the last refused trigger", codes=REFUSAL_CODES),
    _u16("last_refused_trigger_id", 117, "The id of that trigger"),
    _u32("writer_ipv4", 118, "IPv4 address of the client that may write, first octet highest; 0 for none"),
    _u32("latched_lot_checksum", 120, "CRC-32 of the lot id in force, in ASCII without its filling; 0 for none"),
    _u32("acknowledged_sequence_echo", 122, "The sequence up to which results are taken as acknowledged"),
    _u32("result_deadline_ms", 124, "Longest time from the last trigger's acceptance to its result", RO, "ms"),
    _u16("interface_boots", 126, "Starts of this interface, modulo 65536"),
    _u16("station_boots", 127, "Starts of the station that this interface has seen, modulo 65536"),
)  # fmt: skip

RESULT = (
    _u32("result_sequence", 128, "The inspection's number, 0 if no result is published"),
    _u16("result_trigger_id", 130, "The trigger id that this is the result of"),
    Register("result_flags", 131, Kind.BITS, RO, "", None, None, "About the result", bits=FLAG_BITS),
    Register("result_reasons", 132, Kind.BITS32, RO, "", None, None, "Why it is not PASS", bits=REASON_BITS),
    Register("result_area_mm2_x100", 134, Kind.I32, RO, "mm²/100", 0, 2**31 - 1,
             "The deformed area that decided; 0x80000000: none", invalid=-(2**31)),
    Register("result_area_mm2", 136, Kind.F32, RO, "mm²", 0, 3.4e38, "The same; NaN: none",
             invalid=math.nan),
    Register("result_area_px", 138, Kind.U32, RO, "px", 0, U32_MAX - 1, "The same; 0xFFFFFFFF: none",
             invalid=U32_MAX),
    Register("result_closing_mm_x100", 140, Kind.I16, RO, "mm/100", -(2**15) + 1, 2**15 - 1,
             "Closing since first contact where that area was measured; 0x8000: none", invalid=-(2**15)),
    Register("result_confidence_pct", 141, Kind.U16, RO, "%", 0, 100,
             "Confidence of the measurement; 0xFFFF: none", invalid=U16_MAX),
    _u16("result_recipe", 142, "Number of the recipe used for this result"),
    Register("result_outcome", 143, Kind.U16, RO, "", 0, 3, "The outcome", codes=OUTCOME_CODES),
    _u32("result_recipe_checksum", 144, "CRC-32 of that recipe's canonical JSON"),
    _u32("result_duration_ms", 146, "Time from trigger to outcome, by the monotonic clock", RO, "ms"),
    Register("result_ended_utc_ms", 148, Kind.U64, RO, "ms", 0, U64_MAX, "End of the inspection, UTC since 1970-01-01"),
    _u32("result_encoder", 152, "The line's encoder at the trigger, as given with it or read over CAN", RO, "counts"),
    _u32("result_lot_checksum", 154, "CRC-32 of the lot id of this inspection"),
    _u32("result_sequence_again", 156, "As result_sequence: where they differ the block was read torn, read again"),
    _u16("result_fruit_length_mm_x10", 158, "The fruit's length that this inspection was given; 0: none", RO, "mm/10"),
    _u16("result_size_class", 159, "The fruit's size class that this inspection was given; 0: none"),
    _u32("result_sequence_end", 160, "As result_sequence, for who reads the size too: where they differ read again"),
)  # fmt: skip

MORE_STATUS = (
    Register("alarms_33_to_64", 162, Kind.BITS32, RO, "", None, None, "Active alarms 33 to 64", bits=MORE_ALARM_BITS),
    Register("more_status", 164, Kind.BITS, RO, "", None, None, "Further state", bits=MORE_STATUS_BITS),
)
"""Right behind the result, so that one read still gets everything for a scan; what has no place in the status block."""

COUNTERS = (
    _u32("count_triggers", 200, "Triggers seen, accepted or refused"),
    _u32("count_accepted", 202, "Triggers accepted"),
    _u32("count_pass", 204, "Outcomes PASS"),
    _u32("count_fail", 206, "Outcomes FAIL"),
    _u32("count_no_result", 208, "Outcomes NO_RESULT"),
    _u32("count_missed", 210, "Triggers refused"),
    _u32("count_late", 212, "Outcomes that were late"),
    _u32("count_overrun", 214, "Triggers refused because results wait"),
    _u32(
        "count_communication",
        216,
        "Losses of the writer or its heartbeat, and violations of the handshake, such as a bit that is not reset",
    ),
    _u32("count_bad_requests", 218, "Requests answered with an exception, and malformed ones"),
    _u32("count_refused_connections", 220, "Connections refused or closed by a limit"),
    _u32("counters_epoch", 222, "Raised with each reset of the counters"),
    Register("counters_reset_utc_ms", 224, Kind.U64, RO, "ms", 0, U64_MAX, "The last reset, UTC since 1970-01-01"),
)
"""They wrap round at 2³²."""

IDENTITY = (
    _u16("map_version", 240, "Version of this map"),
    Register("reference_u16", 241, Kind.U16, RO, "", 0, U16_MAX, "Always 0x1234 = 4660: the address is right"),
    _u32("map_checksum", 242, "CRC-32 of this map's canonical table"),
    _u32("reference_u32", 244, "Always 0x12345678 = 305419896: the word order is right"),
    Register("reference_f32", 246, Kind.F32, RO, "", -3.4e38, 3.4e38, "Always 12.34: the word order is right"),
    Register("reference_i16", 248, Kind.I16, RO, "", -(2**15), 2**15 - 1, "Always -2: the sign is right"),
    _u16("queue_places", 249, "Results that can wait in all"),
    Register("reference_text", 250, Kind.TEXT, RO, "", None, None, "Always ABCD: the byte order is right",
             text_words=2),
    Register("reference_u64", 252, Kind.U64, RO, "", 0, U64_MAX, "Always 0x0123456789ABCDEF"),
    Register("software_version", 256, Kind.TEXT, RO, "", None, None, "Version of the software", text_words=8),
    _u32("plc_heartbeat_timeout_ms", 264, "After this time without a change the PLC counts as lost", RO, "ms"),
    _u32("writer_lease_ms", 266, "After this time without a write another client may write", RO, "ms"),
    _u32("handshake_timeout_ms", 268, "After this time a bit that the PLC forgot is answered as if it had fallen",
         RO, "ms"),
    _u32("station_heartbeat_ms", 270, "How often station_heartbeat changes", RO, "ms"),
)  # fmt: skip

REFERENCES: dict[str, int | float | str] = {
    "reference_u16": 0x1234,
    "reference_u32": 0x12345678,
    "reference_f32": 12.34,
    "reference_i16": -2,
    "reference_text": "ABCD",
    "reference_u64": 0x0123456789ABCDEF,
}
"""Contents of the reference registers."""


class Group(NamedTuple):
    """A block of registers without a gap."""

    name: str
    title: str
    registers: tuple[Register, ...]

    @property
    def address(self) -> int:
        """PDU address of its first register."""
        return self.registers[0].address

    @property
    def words(self) -> int:
        """Number of its registers."""
        return self.end - self.address

    @property
    def end(self) -> int:
        """The first address after its registers."""
        return self.registers[-1].end


GROUPS = (
    Group("control", "Control block", CONTROL),
    Group("status", "Status block", STATUS),
    Group("result", "Result block", RESULT),
    Group("more_status", "Further status", MORE_STATUS),
    Group("counters", "Counters", COUNTERS),
    Group("identity", "Identity", IDENTITY),
)
GROUP_BY_NAME = {group.name: group for group in GROUPS}
REGISTERS: tuple[Register, ...] = tuple(register for group in GROUPS for register in group.registers)
"""Ascending, never overlapping."""
BY_NAME = {register.name: register for register in REGISTERS}


def bit_address(register: Register, number: int) -> int:
    """Return the coil or discrete input of a flag: the register's address times 16 + the bit's number."""
    return register.address * 16 + number


def canonical_table() -> str:
    """Return the map as JSON without white space or descriptions: it changes only if clients are affected."""
    rows = [
        {
            "name": register.name,
            "address": register.address,
            "kind": register.kind.value,
            "words": register.words,
            "access": register.access.value,
            "unit": register.unit,
            "bounds": [register.low, register.high],
            "invalid": None if register.invalid is None else str(register.invalid),
            "bits": [[bit.number, bit.name] for bit in register.bits],
            "codes": [[value, code.name] for value, code in register.codes.items()],
        }
        for register in REGISTERS
    ]
    return json.dumps({"version": MAP_VERSION, "registers": rows}, separators=(",", ":"), ensure_ascii=True)


def map_checksum() -> int:
    """Return the CRC-32 (as in zlib) of the canonical table, the value of the register `map_checksum`."""
    return zlib.crc32(canonical_table().encode())
