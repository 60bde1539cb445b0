"""Register map as a document and as a table for a spreadsheet."""

import csv
import io
from collections.abc import Iterator

from plc_interface.registers.alarms import ALARMS
from plc_interface.registers.generate.notices import MADE_BY
from plc_interface.registers.map import GROUPS, MAP_VERSION, REGISTERS, bit_address, map_checksum
from plc_interface.registers.register import Access, Kind, Register

HOLDING, INPUT = 400_001, 300_001
FULL = {Kind.U16: (0, 2**16 - 1), Kind.U32: (0, 2**32 - 1), Kind.U64: (0, 2**64 - 1)}
"""Limits that are the type's own."""
COLUMNS = (
    "name", "pdu_address", "hexadecimal", "reference_4x", "reference_3x", "type", "words", "access", "unit", "low",
    "high", "invalid", "bits", "codes", "meaning",
)  # fmt: skip

_INTRODUCTION = """\
Version {version}, checksum 0x{checksum:08X}: the registers `map_version` and `map_checksum`.
[What the bits mean for the handshake](index.md); [the table as CSV](register-map.csv).

- *PDU* is the address on the wire, from 0; *4x* is the same register in one-based notation, and 3xxxxx too: function
  codes 03 and 04 read alike. Only the control block can be written.
- A type's number is its bits, of 16 in a register; a text's is its registers. A register without limits takes all
  that its type can hold.
- 32- and 64-bit values have their high word first unless the station is configured otherwise; the bytes in a register
  are big-endian. Texts are ASCII, the first character in the high byte, filled up with NUL.
- A 16-bit register of flags can also be reached bit by bit: coil or discrete input = 16 times the PDU address + bit.
- A register with a table of codes takes no other value. Bits without a meaning stay 0.
"""


def markdown() -> str:
    """The document `register-map.md`."""
    lines = [
        "# Register map",
        "",
        f"<!-- {MADE_BY} -->",
        "",
        *_INTRODUCTION.format(version=MAP_VERSION, checksum=map_checksum()).splitlines(),
        "",
        "| block | PDU | words | in one request |",
        "|---|---|---|---|",
        *(
            f"| {group.title} | {group.address} … {group.end - 1} | {group.words} | "
            f"{'write and read' if group.name == 'control' else 'read'} |"
            for group in GROUPS
        ),
        "",
    ]
    for group in GROUPS:
        lines += [
            f"## {group.title}",
            "",
            "| PDU | 4x | name | type | unit | limits | meaning |",
            "|---|---|---|---|---|---|---|",
            *(_row(register) for register in group.registers),
            "",
        ]
        for register in group.registers:
            lines += _details(register)
    return "\n".join(lines)


def table() -> str:
    """The file `register-map.csv`, RFC 4180 with a header."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for register in REGISTERS:
        writer.writerow(
            [
                register.name,
                register.address,
                f"0x{register.address:04X}",
                HOLDING + register.address,
                INPUT + register.address,
                register.kind.value,
                register.words,
                "RW" if register.access is Access.READ_WRITE else "RO",
                register.unit,
                "" if register.low is None else _plain(register.low),
                "" if register.high is None else _plain(register.high),
                "" if register.invalid is None else _invalid(register),
                " ".join(f"{bit.number}:{bit.name}" for bit in register.bits),
                " ".join(f"{value}:{code.name}" for value, code in register.codes.items()),
                register.meaning,
            ]
        )
    return out.getvalue()


def _row(register: Register) -> str:
    bounds = ""
    if register.low is not None and register.high is not None and not register.codes:
        limits = (register.low, register.high)
        bounds = "" if limits == FULL.get(register.kind) else f"{_plain(register.low)} … {_plain(register.high)}"
    kind = register.kind.value
    cells = (
        str(register.address),
        str(HOLDING + register.address),
        f"`{register.name}`",
        f"{kind}[{register.words}]" if register.kind is Kind.TEXT else kind,
        register.unit,
        bounds,
        register.meaning,
    )
    return f"| {' | '.join(cells)} |"


def _details(register: Register) -> Iterator[str]:
    if register.bits and register not in ALARMS:
        yield from (f"### Bits of `{register.name}`", "")
        coils = register.kind is Kind.BITS
        yield from (
            f"| bit |{' coil |' if coils else ''} name | meaning |",
            f"|---|{'---|' * coils}---|---|",
        )
        for bit in register.bits:
            coil = f" {bit_address(register, bit.number)} |" if coils else ""
            yield f"| {bit.number} |{coil} `{bit.name}` | {bit.meaning} |"
        yield ""
    if register.codes:
        yield from (f"### Codes of `{register.name}`", "", "| value | name | meaning |", "|---|---|---|")
        for value, code in register.codes.items():
            shown = f"{value} (0x{value:04X})" if value > 0xFF else str(value)
            yield f"| {shown} | `{code.name}` | {code.meaning} |"
        yield ""


def _plain(number: float) -> str:
    return f"{number:g}" if isinstance(number, float) else str(number)


def _invalid(register: Register) -> str:
    return "NaN" if register.kind is Kind.F32 else str(register.invalid)
