"""A shot is ordered for a count and its echo is checked by its sequence."""

import asyncio
from collections import Counter

import pytest

from plc_interface.outputs.can.errors import (
    EchoMissingError,
    EchoWrongError,
    LateRejectError,
    NotReadyError,
    RejectLostError,
    RejectRefusedError,
)
from plc_interface.outputs.can.link import ORDER
from plc_interface.outputs.can.pending_rejects import Order, PendingRejects, Report
from station.messages import can as messages


def has_message(definition):
    """Return a check that an error's message, or one that it encloses, is of this definition."""
    return lambda error: definition.id in error.message.ids()


def test_shots_are_fired_at_their_counts_and_echoed_by_sequence(on_bus):
    async def scenario(rig):
        await rig.ready()
        far = await rig.order(70_001, 600, lane=2)
        near = await rig.order(70_002, 300, lane=1)
        assert rig.nodes.gate.output == 0
        rig.run_belt()
        first, second = await near, await far
        assert (first.sequence, first.lane, second.sequence, second.lane) == (70_002, 1, 70_001, 2)
        for echo in (first, second):
            assert echo.fired_count >= echo.at_count
        fired = [(shot.sequence, shot.lane, shot.pulse_ms) for shot in rig.nodes.gate.fired]
        assert fired == [(70_002 % 65536, 1, 40), (70_001 % 65536, 2, 40)]
        assert rig.io.counters["shots_fired"] == 2
        assert rig.io.reject_faults == ()

    on_bus(scenario, pulse_ms=40)


def test_a_shot_beyond_the_wrap_is_ahead(on_bus):
    async def scenario(rig):
        await rig.ready()
        shot = await rig.order(1, 500)
        rig.run_belt()
        echo = await shot
        assert echo.at_count < 500
        assert rig.io.count_at_gate(0xFFFF_FFFF) == rig.settings.distance_counts - 1

    # the belt does not move from the start, so that it is the shot that is beyond the wrap
    async def whole(rig):
        rig.faults.set("stuck")
        await scenario(rig)

    on_bus(whole, first_count=2**32 - 400)


def test_a_count_that_is_past_is_refused_and_nothing_is_sent(on_bus):
    async def scenario(rig):
        await rig.ready()
        count = rig.io.encoder_count()
        with pytest.raises(LateRejectError, check=has_message(messages.COUNT_PAST)) as raised:
            await rig.io.divert(9, 1, count)
        assert raised.value.sequence == 9
        assert "shots_ordered" not in rig.io.counters
        assert rig.io.reject_faults == (raised.value.message,)
        rig.io.acknowledge_faults()
        assert rig.io.reject_faults == ()

    on_bus(scenario)


def test_the_gate_itself_refuses_what_is_late_or_bad(on_bus):
    """An order by hand, as from a station whose count is old."""

    async def scenario(rig):
        await rig.ready()
        wire = rig.wire()
        reports = []
        try:
            for sequence, lane, ahead in ((1, 1, -100), (2, 9, 5000), (3, 0, 5000)):
                link = rig.io._link
                link.send(0x200 + 16, ORDER.pack(sequence, lane, 50, (rig.nodes.encoder.count + ahead) % 2**32))
                while not reports or reports[-1][0] != sequence:
                    message = await asyncio.to_thread(wire.recv, 1.0)
                    if message is not None and message.arbitration_id == 0x190:
                        reports.append((int.from_bytes(message.data[:2], "little"), message.data[2]))
        finally:
            wire.shutdown()
        assert reports == [(1, 2), (2, 4), (3, 4)]
        assert not rig.nodes.gate.fired
        await rig.until(lambda: rig.io.counters.get("echoes_unknown") == 3)
        assert rig.io.reject_faults[0] == messages.UNORDERED_REPORT(sequence=1)

    on_bus(scenario)


def test_the_ninth_order_finds_no_place(on_bus):
    async def scenario(rig):
        await rig.ready()
        shots = [await rig.order(sequence, 500 + sequence) for sequence in range(1, 9)]
        ninth = await rig.order(9, 600)
        with pytest.raises(RejectRefusedError, check=has_message(messages.GATE_FULL)):
            await ninth
        rig.run_belt()
        assert [(await shot).sequence for shot in shots] == list(range(1, 9))

    on_bus(scenario)


def test_a_missing_echo_is_a_fault_with_the_sequence(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("no_echo")
        with pytest.raises(EchoMissingError, check=has_message(messages.NOT_CONFIRMED)):
            await (await rig.order(7, 400))
        rig.faults.clear("no_echo")
        shot = await rig.order(8, 400)
        rig.faults.set("no_echo")
        rig.run_belt()
        with pytest.raises(EchoMissingError, check=has_message(messages.NOT_REPORTED)):
            await shot
        assert rig.io.counters["echoes_missing"] == 2
        assert [fault.parameters["sequence"] for fault in rig.io.reject_faults] == [7, 8]

    on_bus(scenario)


def test_an_echo_under_another_sequence_is_no_echo(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("wrong")
        with pytest.raises(EchoMissingError, check=has_message(messages.SHOT)):
            await (await rig.order(20, 400))
        assert rig.io.reject_faults[0] == messages.UNORDERED_REPORT(sequence=21)
        assert rig.io.counters["echoes_unknown"] == 1

    on_bus(scenario)


def test_a_late_echo_is_counted_and_is_nobodys(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("delayed", 1.5)
        shot = await rig.order(5, 400)
        with pytest.raises(EchoMissingError):
            await shot
        await rig.until(lambda: rig.io.counters.get("echoes_late"))
        assert "echoes_unknown" not in rig.io.counters

    on_bus(scenario, echo_deadline_s=0.5)


def test_a_shot_at_another_count_is_a_wrong_echo(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("misplaced", 1000)
        shot = await rig.order(3, 400)
        rig.run_belt()
        with pytest.raises(EchoWrongError, check=has_message(messages.FIRED_LATE)):
            await shot

    on_bus(scenario, tolerance_counts=500, echo_deadline_s=5.0)


def test_a_belt_that_does_not_come_ends_the_wait(on_bus):
    async def scenario(rig):
        await rig.ready()
        shot = await rig.order(4, 400)
        with pytest.raises(EchoMissingError, check=has_message(messages.BELT_SLOW)):
            await shot

    on_bus(scenario, shot_deadline_s=0.5)


@pytest.mark.parametrize(("sequence", "lane", "count"), [(0, 1, 5), (2**32, 1, 5), (1, 0, 5), (1, 9, 5), (1, 1, 2**32)])
def test_an_order_beyond_its_bounds_is_refused(on_bus, sequence, lane, count):
    async def scenario(rig):
        with pytest.raises(RejectRefusedError, check=has_message(messages.ORDER_MALFORMED)):
            await rig.io.divert(sequence, lane, count)

    on_bus(scenario, start=False)


def test_no_order_without_a_bus_and_no_sequence_twice(on_bus):
    async def scenario(rig):
        with pytest.raises(NotReadyError, check=has_message(messages.UNHEALTHY)):
            await rig.io.divert(1, 1, 5000)
        await rig.ready()
        first = await rig.order(65_537, 400)
        with pytest.raises(RejectRefusedError, check=has_message(messages.ORDERED_TWICE)):
            await rig.io.divert(1, 1, (rig.nodes.encoder.count + 500) % 2**32)
        rig.run_belt()
        assert (await first).sequence == 65_537

    on_bus(scenario)


def test_a_gate_lost_under_way_ends_the_shot(on_bus):
    async def scenario(rig):
        await rig.ready()
        shot = await rig.order(6, 400)
        rig.faults.set("gate_silent")
        with pytest.raises(RejectLostError, check=has_message(messages.SILENT)):
            await shot
        assert not rig.nodes.gate.fired

    on_bus(scenario)


def test_the_gates_late_answer_is_a_late_shot():
    async def scenario():
        counters: Counter[str] = Counter()
        shots = PendingRejects(counters, tolerance_counts=10)

        async def ordered():
            with shots.under_way(Order(65_540, 1, 500)) as shot:
                shots.on_report(Report(4, 2, 510))
                await shot.next()

        with pytest.raises(LateRejectError, check=has_message(messages.ORDER_LATE)):
            await ordered()
        assert counters["shots_failed"] == 1

    asyncio.run(scenario())
