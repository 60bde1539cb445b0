"""The fruit's size on its way through the interface: given with a trigger, used up by it, echoed with its outcome."""

import asyncio
import signal

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.state import Size
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME
from station.channel.line import BeginReply, Refusal

NONE = (0, 0)


def asked(made):
    """Sizes of the inspections that the station was asked for."""
    return [(ask.fruit_length_mm_x10, ask.size_class) for ask in made.of(do.RequestBegin)]


def end(made, sequence):
    """Have the inspection under way end, and its result acknowledged."""
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=sequence, deadline_s=2.0))
    made.write("enable")
    trigger_id, size = made.state.running.trigger_id, made.state.running
    outcome = made.outcome(sequence=sequence, trigger_id=trigger_id).model_copy(
        update={"fruit_length_mm_x10": size.fruit_length_mm_x10, "size_class": size.size_class}
    )
    made.feed(ev.OutcomeReceived, outcome)
    made.write("enable", acknowledged_sequence=sequence)


def test_a_size_may_come_with_the_trigger_or_before_it(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=1, fruit_length_mm_x10=480, size_class=3)
    end(made, 101)
    made.feed(ev.PlcWrote, made.inputs, frozenset({"plc_heartbeat"}))
    made.write("enable", fruit_length_mm_x10=455)
    made.write("enable", size_class=2)
    made.feed(ev.PlcWrote, made.inputs, frozenset({"plc_heartbeat"}))
    made.write("enable", "trigger", trigger_id=2)
    assert asked(made) == [(480, 3), (455, 2)]


def test_a_size_that_is_not_written_again_is_not_the_next_fruits_and_the_same_one_written_again_is(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=1, fruit_length_mm_x10=480, size_class=3)
    end(made, 101)
    made.write("enable", "trigger", trigger_id=2)
    end(made, 102)
    made.write("enable", "trigger", trigger_id=3, fruit_length_mm_x10=480)
    assert made.inputs.size_class == 3, "it stands in its register"
    assert asked(made) == [(480, 3), NONE, (480, 0)]


def test_a_refused_trigger_uses_the_size_up_as_well(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=0, fruit_length_mm_x10=300)
    assert made.state.last_refusal is Refusal.BAD_TRIGGER_ID
    made.write("enable")
    made.write("enable", "trigger", trigger_id=2)
    assert asked(made) == [NONE]


@pytest.mark.parametrize("written", ["before", "with a trigger bit that is still up"])
def test_a_size_of_another_writer_is_forgotten(bench, written):
    made = bench()
    made.armed()
    if written == "before":
        made.write("enable", fruit_length_mm_x10=300)
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
        made.write()
    else:
        made.write("enable", "trigger", trigger_id=1)
        end(made, 101)
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
        made.write("trigger", trigger_id=1, fruit_length_mm_x10=300)
        made.write()
    made.write("enable")
    made.write("enable", "trigger", trigger_id=2)
    assert asked(made)[-1] == NONE
    assert made.state.size == Size()


def test_wrong_and_stale_sizes_reach_the_station_and_the_result_as_they_were_given(cell):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm()

            async def inspected(number, **size):
                if size:
                    await plc.write(**size)
                await plc.trigger(number)
                begun = station.begun[station.running]
                station.finish("PASS")
                shown = await plc.wait("result_valid", result_trigger_id=number)
                assert shown["result_sequence"] == shown["result_sequence_end"]
                await plc.write(acknowledged_sequence=shown["result_sequence"])
                await plc.wait(without="result_valid", result_fruit_length_mm_x10=0, result_size_class=0)
                echo = (shown["result_fruit_length_mm_x10"], shown["result_size_class"])
                assert echo == (begun.fruit_length_mm_x10, begun.size_class)
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
            begun = made.station.begun[made.station.running]
            made.station.finish("PASS")
            await plc.wait("result_valid", result_trigger_id=9)
            answer = await plc._client.read_holding_registers(GROUP_BY_NAME["status"].address, count=old_read)
            return begun, old_words, old_read, answer

    begun, words, count, answer = asyncio.run(scenario())
    assert (words, count, len(answer.registers)) == (27, 58, 58)
    assert (begun.trigger_id, begun.fruit_length_mm_x10, begun.size_class) == (9, 0, 0)


@pytest.mark.parametrize("lost", ["station", "interface"])
def test_the_outcome_of_a_fruit_whose_station_or_interface_died_has_its_size(cell, lost):
    async def scenario():
        async with cell(handshake_station_lost_after_s=0.4) as made:
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
            shown = await plc.wait("result_valid", "error", result_trigger_id=1)
            assert shown["result_reasons"] == {"station_lost"}
            return shown["result_fruit_length_mm_x10"], shown["result_size_class"]

    assert asyncio.run(scenario()) == (480, 3)
