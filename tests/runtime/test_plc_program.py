"""The Structured Text's example as a PLC's program in a scan loop: Modbus TCP, interface, station and twin."""

import asyncio
import time

import pytest
from pymodbus.client import AsyncModbusTcpClient

from plc_interface.registers.generate.structured_text import data_types, example, function_block
from plc_interface.registers.map import BY_NAME, CONTROL, MORE_STATUS, STATUS
from tests.plc_interface.registers.generate.structured_text.conftest import Library

FIRST, WORDS = STATUS[0].address, MORE_STATUS[-1].end - STATUS[0].address
SCAN_S = 0.02


def program_for(station_is_simulated):
    """The shipped text; heartbeats and results of a busy machine come late, and a test's station has no deadline."""
    text = example().replace("heartbeat_timeout := T#2s", "heartbeat_timeout := T#20s")
    text = text.replace("answer_timeout := T#2s", "answer_timeout := T#20s")
    text = text.replace("inspection_timeout := T#20s", "inspection_timeout := T#100s")
    if station_is_simulated:
        text = text.replace("accept_simulated := FALSE", "accept_simulated := TRUE")
    return Library(data_types(), function_block(), text)


class Controller:
    """A PLC's runtime: one exchange, one scan."""

    def __init__(self, library, client):
        self._library, self._client = library, client
        self.program = library.unit("PRG_FruitStationExample")
        self.block = self.program["fruit_station"]
        library.now_s = time.monotonic()
        self.program(exchange_ok=False)

    async def scan(self, **inputs):
        answer = await self._client.readwrite_registers(
            read_address=FIRST, read_count=WORDS, write_address=CONTROL[0].address, values=self.program["sent"]
        )
        assert not answer.isError(), answer
        self._library.now_s = time.monotonic()
        self.program(received=answer.registers, exchange_ok=True, line_running=True, **inputs)
        await asyncio.sleep(SCAN_S)

    async def until(self, output, *, is_so, **inputs):
        async with asyncio.timeout(100):
            while self.block[output] != is_so:
                await self.scan(**inputs)


def outcome_of(controller):
    return BY_NAME["result_outcome"].codes[controller.block["result"]["outcome"]].name


@pytest.mark.timeout(300)
def test_three_fruits_by_the_shipped_program_and_one_that_a_simulated_station_may_not_let_pass(
    bench, plc_port, settings_file
):
    # Parsed before, since that takes seconds, in which the station of this process would do nothing.
    lenient, shipped = (program_for(station_is_simulated=simulated) for simulated in (True, False))

    async def scenario():
        file = settings_file()
        async with bench(file) as cell, plc_port(file) as port:
            await cell.choose("blueberry")
            client = AsyncModbusTcpClient("127.0.0.1", port=port, timeout=10, retries=0)
            assert await client.connect()
            controller = Controller(lenient, client)
            for number in (1, 2, 3):
                await controller.until("ready", is_so=True, fruit_in_place=False)
                await controller.until("done", is_so=True, fruit_in_place=True, line_encoder=number << 16)
                result = controller.block["result"]
                ended = {name: controller.block[name] for name in ("refused", "refusal", "timed_out")}
                assert ended == {"refused": False, "refusal": 0, "timed_out": False}
                assert (result["trigger_id"], result["encoder"]) == (number, number << 16)
                assert outcome_of(controller) == "PASS"
                assert controller.program["let_pass"]
                await controller.until("may_move", is_so=True, fruit_in_place=True)
                assert controller.program["move_fruit"]
                assert cell.twin.world.opening_mm() == pytest.approx(85, abs=1), "the line moves the fruit now"
                await controller.until("done", is_so=False, fruit_in_place=False)
            client.close()

            strict = AsyncModbusTcpClient("127.0.0.1", port=port, timeout=10, retries=0)
            assert await strict.connect()
            controller = Controller(shipped, strict)
            await controller.until("ready", is_so=True, fruit_in_place=False)
            await controller.until("done", is_so=True, fruit_in_place=True)
            assert (outcome_of(controller), controller.block["result"]["simulated"]) == ("PASS", True)
            assert not controller.program["let_pass"]
            strict.close()

    asyncio.run(scenario())
