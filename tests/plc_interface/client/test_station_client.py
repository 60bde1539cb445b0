"""The client against the real server and handshake, and against servers that are not what it takes them for."""

import asyncio
import contextlib
import zlib

import pytest

from plc_interface.client import StationClient
from plc_interface.client.errors import (
    CommandFailedError,
    DeadlineMissedError,
    NotReadyError,
    ReferencesError,
    RequestRefusedError,
    TriggerRefusedError,
    UnreachableError,
)
from plc_interface.registers.codec import RegisterValueError, WordOrder
from plc_interface.registers.map import BY_NAME, REFERENCES
from plc_interface.server.exceptions import illegal_address
from station.channel.line import Refusal

HOST = "127.0.0.1"


@pytest.mark.parametrize("order", WordOrder)
def test_an_inspection_in_either_word_order(serve, order):
    async def main():
        async with serve(order) as rig, StationClient(HOST, rig.port, order=order) as client:
            await client.arm()
            await client.latch_lot("LOT-1")
            result = await client.inspect(7, encoder=0x12345678)
            after = await client.pending_result()
            return rig.accepted, result, after, await client.counters()

    accepted, result, after, counters = asyncio.run(main())
    assert accepted == [(7, 0x12345678, "LOT-1")]
    assert (result.sequence, result.trigger_id, result.outcome, result.passed) == (0x00010001, 7, "PASS", True)
    assert result.flags == {"pass", "area_valid", "simulated"}
    assert (result.area_mm2, result.area_px, result.closing_mm, result.confidence_pct) == (12.34, 70_001, 0.75, 87)
    assert (result.recipe, result.recipe_checksum, result.ended_utc_ms) == (3, 0xCAFE, 2**40)
    assert (result.duration_ms, result.encoder) == (100_000, 0x12345678)
    assert result.lot_checksum == zlib.crc32(b"LOT-1")
    assert after is None
    assert (counters["count_accepted"], counters["count_pass"]) == (1, 1)


def test_a_size_goes_with_its_fruit_and_comes_back_with_its_result(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            sized = await client.inspect(7, fruit_length_mm=48.04, size_class=3)
            unsized = await client.inspect(8)
            with pytest.raises(RegisterValueError, match="fruit_length_mm_x10"):
                await client.inspect(9, fruit_length_mm=7000.0)
            return rig.sizes, sized, unsized

    sizes, sized, unsized = asyncio.run(main())
    assert sizes == [(480, 3), (0, 0)]
    assert (sized.fruit_length_mm, sized.size_class) == (48.0, 3)
    assert (unsized.fruit_length_mm, unsized.size_class) == (None, None)


def test_what_is_not_measured_is_none_and_does_not_pass(serve, no_contact):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            rig.outcome = no_contact
            await client.arm()
            return await client.inspect(7)

    result = asyncio.run(main())
    assert (result.outcome, result.passed, result.reasons) == ("NO_RESULT", False, {"no_contact", "low_confidence"})
    assert (result.area_mm2, result.area_px, result.closing_mm, result.confidence_pct) == (None, None, None, None)
    assert result.flags == {"partial", "simulated"}


def test_a_result_is_acknowledged_also_where_an_inspection_behind_it_was_called_off(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            rig.state.journal = rig.state.journal.model_copy(update={"hidden": (rig.first_sequence + 1,)})
            result = await client.inspect(7)
            await client.acknowledge(result.sequence)
            return result.sequence, rig.state.journal.acknowledged

    sequence, acknowledged = asyncio.run(main())
    assert acknowledged == sequence + 1


def test_twenty_fruits_in_a_row_each_get_their_own(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            rig.inspection_s = 0.0
            await client.arm()
            return [await client.inspect(number, encoder=number) for number in range(65_530, 65_536)] + [
                await client.inspect(number, encoder=number) for number in range(1, 15)
            ]

    results = asyncio.run(main())
    assert [result.trigger_id for result in results] == [*range(65_530, 65_536), *range(1, 15)]
    assert [result.encoder for result in results] == [result.trigger_id for result in results]
    assert len({result.sequence for result in results}) == 20


def test_a_refusal_has_its_reason_and_the_next_fruit_goes(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            rig.refusal = Refusal.RECORDS_FULL
            with pytest.raises(TriggerRefusedError, match="could not store the trigger") as caught:
                await client.inspect(7)
            rig.refusal = None
            return caught.value.reason, await client.inspect(7)

    reason, result = asyncio.run(main())
    assert reason == "records_full"
    assert result.trigger_id == 7


def test_a_result_that_comes_too_late_is_not_the_next_fruits(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            rig.inspection_s = 0.6
            with pytest.raises(DeadlineMissedError, match="result of trigger 7 did not come in time"):
                await client.inspect(7, deadline_s=0.3)
            async with asyncio.timeout(20):
                while (late := await client.pending_result()) is None:
                    await asyncio.sleep(0.01)
            with pytest.raises(NotReadyError, match="result 65537 of trigger 7 waits"):
                await client.inspect(8)
            with pytest.raises(NotReadyError, match="result 3 is not the one shown, which is 65537"):
                await client.acknowledge(3)
            assert await client.pending_result() == late
            await client.acknowledge(late.sequence)
            await client.acknowledge(late.sequence)
            rig.inspection_s = 0.05
            return late, await client.inspect(8)

    late, result = asyncio.run(main())
    assert (late.trigger_id, result.trigger_id) == (7, 8)


@pytest.mark.parametrize(
    ("trigger_id", "message"), [(0, "is no trigger id"), (65_536, "is no trigger id"), (7, "another")]
)
def test_a_trigger_that_could_only_be_refused_is_not_given(serve, trigger_id, message):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            await client.inspect(7)
            with pytest.raises(NotReadyError, match=message):
                await client.inspect(trigger_id)
            return len(rig.accepted), await client.read("count_triggers")

    assert asyncio.run(main()) == (1, 1)


def test_without_arming_nothing_is_triggered(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            with pytest.raises(NotReadyError, match=r"arm\(\)"):
                await client.inspect(7)
            return rig.accepted

    assert asyncio.run(main()) == []


def test_its_heartbeat_keeps_it_armed_and_its_end_disarms(serve):
    async def main():
        async with serve() as rig:
            async with StationClient(HOST, rig.port) as client:
                await client.arm()
                await asyncio.sleep(2 * rig.settings.plc_heartbeat_timeout_s)
                ready = "trigger_ready" in await client.status()
                await client.disarm()
                owned = "writer_owned" in await client.status()
            async with StationClient(HOST, rig.port) as other:
                await other.arm()
            async with asyncio.timeout(20):
                while rig.state.writer:
                    await asyncio.sleep(0.01)
            return ready, owned, rig.state.arming.value

    assert asyncio.run(main()) == (True, False, "withdrawn")


async def beats_on(client):
    """Wait for the next heartbeat that the station has noted."""
    noted = await client.read("plc_heartbeat_echo")
    async with asyncio.timeout(20):
        while await client.read("plc_heartbeat_echo") == noted:
            await asyncio.sleep(0.01)


async def inspect_until_it_is_not_ready(client):
    async with asyncio.timeout(20):
        while True:
            with contextlib.suppress(RequestRefusedError):
                await client.inspect(7)


def test_armed_again_it_beats_again(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            await beats_on(client)
            await client.disarm()
            await client.disarm()
            with pytest.raises(NotReadyError, match=r"not armed: call arm\(\) first"):
                await client.inspect(7)
            await client.arm()
            await client.arm()
            await beats_on(client)
            return await client.inspect(7)

    assert asyncio.run(main()).trigger_id == 7


def test_a_heartbeat_that_ended_is_reported_and_armed_again_it_beats_again(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            await beats_on(client)
            await client.write({"write_key": 0})  # the next beat is refused, as it is beside another writer
            with pytest.raises(NotReadyError, match=r"heartbeat has ended \(.* exception 06: .*call arm\(\) again"):
                await inspect_until_it_is_not_ready(client)
            assert rig.accepted == []
            await client.arm()
            await beats_on(client)
            return await client.inspect(7)

    assert asyncio.run(main()).trigger_id == 7


def test_a_second_client_may_read_but_not_write(serve):
    async def main():
        async with (
            serve() as rig,
            StationClient(HOST, rig.port) as first,
            StationClient(HOST, rig.port) as second,
        ):
            await first.arm()
            with pytest.raises(RequestRefusedError, match="another client holds the right to write") as caught:
                await second.arm()
            return caught.value.code, await second.read("reference_i16"), await first.inspect(7)

    code, reference, result = asyncio.run(main())
    assert (code, reference, result.trigger_id) == (6, -2, 7)


def test_commands(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            await client.change_recipe(12)
            rig.command_fails = "there is no recipe 13"
            with pytest.raises(CommandFailedError, match="change_recipe 13 was not carried out") as caught:
                await client.change_recipe(13)
            rig.command_fails = ""
            await client.change_recipe(14)
            return rig.commands, caught.value.result

    commands, result = asyncio.run(main())
    assert commands == [("change_recipe", 12), ("change_recipe", 13), ("change_recipe", 14)]
    assert result == "failed"


@pytest.mark.parametrize("lot", ["x" * 33, "Blåbär"])
def test_a_lot_that_no_register_can_hold_is_told_before_anything_is_written(serve, lot):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            with pytest.raises(RegisterValueError, match="lot"):
                await client.latch_lot(lot)
            return rig.image.value("lot")

    assert asyncio.run(main()) == ""


def test_a_refused_write_says_why(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            with pytest.raises(RequestRefusedError, match=r"exception 02: .*read-only") as read_only:
                await client.write({"status": 1})
            with pytest.raises(RequestRefusedError, match=r"exception 03") as bad:
                await client.write({"control": 0x8000})
            return read_only.value.code, bad.value.code

    assert asyncio.run(main()) == (2, 3)


@pytest.mark.parametrize("order", WordOrder)
def test_the_other_word_order_is_found(serve, order):
    other = next(one for one in WordOrder if one is not order)

    async def main():
        async with serve(order) as rig:
            with pytest.raises(ReferencesError, match=f"other word order, {order}"):
                await StationClient(HOST, rig.port, order=other).connect()

    asyncio.run(main())


@pytest.mark.parametrize(("shift", "message"), [(1, "above where the map has it"), (-1, "below where the map has it")])
def test_an_address_that_is_off_by_one_is_found(serve, monkeypatch, shift, message):
    async def main():
        async with serve() as rig:
            read = rig.image.registers
            monkeypatch.setattr(rig.image, "registers", lambda address, count: read(address - shift, count))
            with pytest.raises(ReferencesError, match=message):
                await StationClient(HOST, rig.port).connect()

    asyncio.run(main())


def test_swapped_bytes_another_map_and_no_station_at_all_are_told_apart(serve, monkeypatch):
    async def main():
        async with serve() as rig:
            read = rig.image.registers

            def swapped(address, count):
                raw = read(address, count)
                return bytes(raw[at ^ 1] for at in range(len(raw)))

            monkeypatch.setattr(rig.image, "registers", swapped)
            with pytest.raises(ReferencesError, match="bytes of each register are swapped"):
                await StationClient(HOST, rig.port).connect()
            monkeypatch.setattr(rig.image, "registers", read)
            rig.image.commit({"map_version": 2})
            with pytest.raises(ReferencesError, match="version 2 of the map, this client has 1"):
                await StationClient(HOST, rig.port).connect()
            rig.image.commit(dict.fromkeys(set(REFERENCES) - {"reference_text"}, 0))
            with pytest.raises(ReferencesError, match="no fruit station"):
                await StationClient(HOST, rig.port).connect()

    asyncio.run(main())


def test_a_map_of_the_same_version_may_have_more_than_the_client_knows_and_not_less(serve, monkeypatch):
    async def main():
        async with serve() as rig:
            rig.image.commit({"map_checksum": 1})
            async with StationClient(HOST, rig.port) as client:
                await client.arm()
                grown = await client.inspect(7)
            read, end = rig.image.registers, BY_NAME["more_status"].address

            def older(address, count):
                if address <= end < address + count:
                    raise illegal_address("not in this map")
                return read(address, count)

            monkeypatch.setattr(rig.image, "registers", older)
            with pytest.raises(ReferencesError, match="older map, without all registers 162 to 164: update"):
                await StationClient(HOST, rig.port).connect()
            return grown

    assert asyncio.run(main()).trigger_id == 7


def test_the_numbers_of_all_active_alarms(serve):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            before = await client.alarms()
            rig.alarms = {1, 32, 33, 64}
            rig.beat()
            return before, await client.alarms()

    assert asyncio.run(main()) == ((), (1, 32, 33, 64))


def test_nobody_there_and_a_link_that_breaks(serve, unused_port):
    async def main():
        with pytest.raises(UnreachableError, match="nobody answers"):
            await StationClient(HOST, unused_port).connect()
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            await rig.server.stop()
            with pytest.raises(UnreachableError, match="did not answer when asked to read"):
                await client.pending_result()

    asyncio.run(main())


def test_a_result_of_another_fruit_is_never_returned(serve):
    """A station gone mad: the result block shows another id under the sequence that was started."""

    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            commit = rig.image.commit
            rig.image.commit = lambda values: commit(
                {**values, "result_trigger_id": 8} if values.get("result_trigger_id") == 7 else values
            )
            with pytest.raises(DeadlineMissedError):
                await client.inspect(7, deadline_s=1.0)
            shown = await client.pending_result()
            assert shown is not None
            return shown.trigger_id

    assert asyncio.run(main()) == 8


@pytest.mark.parametrize("copy", ["result_sequence_again", "result_sequence_end"])
def test_a_torn_result_is_never_returned(serve, copy):
    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            await client.arm()
            commit = rig.image.commit
            rig.image.commit = lambda values: commit({**values, copy: 3} if values.get(copy) else values)
            with pytest.raises(DeadlineMissedError):
                await client.inspect(7, deadline_s=1.0)

    asyncio.run(main())


def test_a_client_closes_also_where_pymodbus_loses_the_end_of_its_heartbeat(serve):
    """As `asyncio.wait_for` of Python 3.11 does with a cancellation that comes with the answer."""

    async def main():
        async with serve() as rig, StationClient(HOST, rig.port) as client:
            answered, write = asyncio.Event(), client._client.write_registers

            async def losing(*arguments, **options):
                answer = await write(*arguments, **options)
                answered.set()
                with contextlib.suppress(asyncio.CancelledError):
                    await asyncio.sleep(0.5)
                return answer

            await client.arm()
            client._client.write_registers = losing
            await answered.wait()
            async with asyncio.timeout(20):
                await client.close()

    asyncio.run(main())
