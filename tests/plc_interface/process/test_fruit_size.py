"""The fruit's size on the wire: reaches the station as it was given, and is echoed with the result."""

import asyncio
import signal

import pytest

from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME

NONE = (0, 0)


def test_wrong_and_stale_sizes_reach_the_station_and_the_result_as_they_were_given(cell):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm()

            async def inspected(number, **size):
                if size:
                    await plc.write(**size)
                await plc.trigger(number)
                request = station.accepted[station.running]
                station.finish("PASS")
                shown = await plc.wait("result_valid", result_trigger_id=number)
                assert shown["result_sequence"] == shown["result_sequence_end"]
                await plc.write(acknowledged_sequence=shown["result_sequence"])
                await plc.wait(without="result_valid", result_fruit_length_mm_x10=0, result_size_class=0)
                echo = (shown["result_fruit_length_mm_x10"], shown["result_size_class"])
                assert echo == (request.fruit_length_mm_x10, request.size_class)
                return echo

            assert await inspected(1) == NONE
            assert await inspected(2, fruit_length_mm_x10=480, size_class=3) == (480, 3)
            assert await inspected(3) == NONE, "stale"
            assert await inspected(4, fruit_length_mm_x10=480) == (480, 0)
            assert await inspected(5, fruit_length_mm_x10=65_535, size_class=65_535) == (65_535, 65_535)
            assert await inspected(6, fruit_length_mm_x10=0, size_class=0) == NONE
            await plc.write(fruit_length_mm_x10=480)
            plc.close()
            plc = await made.plc()
            await plc.arm()
            assert await inspected(7) == NONE, "of the writer before"

    asyncio.run(scenario())


def test_a_program_that_knows_no_size_reads_and_writes_as_before(cell):
    old_words = BY_NAME["fruit_length_mm_x10"].address
    old_read = BY_NAME["result_fruit_length_mm_x10"].address - GROUP_BY_NAME["status"].address

    async def scenario():
        async with cell() as made:
            plc = await made.plc()
            await plc.arm()
            block = [0] * old_words
            block[0] = BY_NAME["control"].flags(["enable", "trigger"])
            block[BY_NAME["trigger_id"].address], block[BY_NAME["write_key"].address] = 9, 0x5AFE
            assert not (await plc._client.write_registers(0, block)).isError()
            await plc.wait("inspecting")
            request = made.station.accepted[made.station.running]
            made.station.finish("PASS")
            await plc.wait("result_valid", result_trigger_id=9)
            answer = await plc._client.read_holding_registers(GROUP_BY_NAME["status"].address, count=old_read)
            return request, old_words, old_read, answer

    request, words, count, answer = asyncio.run(scenario())
    assert (words, count, len(answer.registers)) == (27, 58, 58)
    assert (request.trigger_id, request.fruit_length_mm_x10, request.size_class) == (9, 0, 0)


@pytest.mark.parametrize("lost", ["station", "interface"])
def test_the_outcome_of_a_fruit_whose_station_or_interface_died_has_its_size(cell, lost, limit_s):
    async def scenario():
        async with cell(handshake_station_lost_after_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            await plc.write(fruit_length_mm_x10=480, size_class=3)
            await plc.trigger(1)
            await station.die()
            if lost == "interface":
                await made.end(signal.SIGKILL)
                plc.close()
                await made.start()
                plc = await made.plc()
                await plc.write(control=0)
            shown = await plc.wait("result_valid", "error", result_trigger_id=1)
            assert shown["result_reasons"] == {"station_lost"}
            return shown["result_fruit_length_mm_x10"], shown["result_size_class"]

    assert asyncio.run(scenario()) == (480, 3)
