"""Maps that were published under the present version: programs made from them read and write as before.

`published` has the table of each, named by its checksum. Add the last one before the map grows again.
"""

import asyncio
import math
import struct
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest
from pymodbus.client import AsyncModbusTcpClient

from plc_interface.registers.map import BY_NAME, MAP_VERSION
from tests.tables import read_table

PUBLISHED = sorted((Path(__file__).parent / "published").glob("*.csv"))
FORMATS = {
    "u16": "H", "i16": "h", "bits16": "H", "u32": "I", "i32": "i", "f32": "f", "bits32": "I", "u64": "Q",
}  # fmt: skip
DEADLINE_S = 20.0


def numbered(cell):
    """A cell's flags or codes: name by number."""
    return {int(number): name for number, name in (pair.split(":") for pair in cell.split())}


@pytest.fixture(params=PUBLISHED, ids=lambda path: path.stem)
def rows(request):
    return read_table(request.param)


def test_what_was_published_is_where_it_was_and_what_it_was(rows):
    assert MAP_VERSION == 1
    assert len(rows) > 70
    for row in rows:
        register = BY_NAME[row["name"]]
        here = (register.address, register.kind.value, register.words, register.unit)
        assert here == (int(row["pdu_address"]), row["type"], int(row["words"]), row["unit"])
        assert register.access.value == {"RW": "read and write", "RO": "read only"}[row["access"]]
        for cell, now in (("low", register.low), ("high", register.high), ("invalid", register.invalid)):
            was = math.nan if row[cell] == "" else float(row[cell])
            assert was == pytest.approx(math.nan if now is None else now, nan_ok=True)
        assert numbered(row["bits"]).items() <= {bit.number: bit.name for bit in register.bits}.items()
        assert numbered(row["codes"]).items() <= {value: code.name for value, code in register.codes.items()}.items()


class OldProgram:
    """A PLC's program that knows nothing but a published table."""

    def __init__(self, rows, client):
        self.rows, self.client = {row["name"]: row for row in rows}, client
        self.blocks = []
        for _, block in groupby(enumerate_ends(rows), key=lambda item: item[0]):
            self.blocks.append([row for _, row in block])

    async def write(self, *bits, **values):
        """The whole control block, by its own length."""
        known = {name: number for number, name in numbered(self.rows["control"]["bits"]).items()}
        values |= {"control": sum(1 << known[bit] for bit in bits), "write_key": 0x5AFE}
        (block,) = (block for block in self.blocks if block[0]["name"] == "control")
        words = [0] * sum(int(row["words"]) for row in block)
        for name, value in values.items():
            words[int(self.rows[name]["pdu_address"])] = value
        assert not (await self.client.write_registers(0, words)).isError()

    async def read(self):
        """Every block in a request of its own."""
        values = {}
        for block in self.blocks:
            first, count = int(block[0]["pdu_address"]), sum(int(row["words"]) for row in block)
            answer = await self.client.read_holding_registers(first, count=count)
            assert not answer.isError(), (first, count)
            raw = struct.pack(f">{count}H", *answer.registers)
            for row in block:
                at, size = 2 * (int(row["pdu_address"]) - first), 2 * int(row["words"])
                values[row["name"]] = self.value(row, raw[at : at + size])
        return values

    def value(self, row, raw) -> Any:
        if row["type"] == "text":
            return raw.rstrip(b"\0").decode("ascii")
        (number,) = struct.unpack(">" + FORMATS[row["type"]], raw)
        none = row["invalid"] and (math.isnan(number) if row["invalid"] == "NaN" else number == float(row["invalid"]))
        return None if none else number

    async def until(self, bit):
        known = {name: number for number, name in numbered(self.rows["status"]["bits"]).items()}
        async with asyncio.timeout(DEADLINE_S):
            while not (seen := await self.read())["status"] >> known[bit] & 1:
                await asyncio.sleep(0.01)
        return seen


def enumerate_ends(rows):
    """Each row with the number of gaps before it."""
    gaps, end = 0, 0
    for row in rows:
        gaps += int(row["pdu_address"]) != end
        end = int(row["pdu_address"]) + int(row["words"])
        yield gaps, row


def test_a_program_made_from_it_inspects_a_fruit_and_reads_what_the_registers_have(serve, rows):
    async def main():
        async with serve() as rig:
            rig.alarms = {1, 32, 33, 40}
            client = AsyncModbusTcpClient("127.0.0.1", port=rig.port, retries=0, reconnect_delay=0)
            try:
                assert await client.connect()
                program = OldProgram(rows, client)
                await program.write()
                await program.write("enable")
                await program.until("trigger_ready")
                await program.write("enable", "trigger", trigger_id=7)
                await program.until("trigger_acknowledged")
                await program.write("enable", trigger_id=7)
                seen = await program.until("result_valid")
            finally:
                client.close()
            return seen, {row["name"]: rig.image.value(row["name"]) for row in rows}, rig.accepted

    seen, there, accepted = asyncio.run(main())
    assert [trigger_id for trigger_id, _, _ in accepted] == [7]
    changing = {"station_heartbeat"}
    assert {name: value for name, value in seen.items() if name not in changing} == {
        name: pytest.approx(value, rel=1e-6) if isinstance(value, float) else value
        for name, value in there.items()
        if name not in changing
    }
    assert seen["alarms"] == 1 << 31 | 1
    assert (seen["result_trigger_id"], seen["result_area_mm2_x100"], seen["result_outcome"]) == (7, 1234, 1)
