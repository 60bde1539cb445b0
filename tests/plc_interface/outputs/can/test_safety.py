"""Failures on the CAN: each leads to a safe output, a sentence, a count, and a way back."""

import asyncio
import struct

import can
import pytest

from plc_interface.outputs.can.errors import NotReadyError, RejectLostError
from plc_interface.outputs.can.link import ORDER
from station.messages import can as messages

UP = messages.COMING_UP()


def has_message(definition):
    """Return a check that an error's message, or one that it encloses, is of this definition."""
    return lambda error: definition.id in error.message.ids()


def test_without_the_stations_heartbeat_the_gate_is_safe_alone_and_remembers(on_bus):
    """The driver is stopped, and the heartbeat that comes back is not enough to make the gate work again."""

    async def scenario(rig):
        await rig.ready()
        gate = rig.nodes.gate
        shot = await rig.order(1, 400)
        assert gate.output == 0
        rig.io.renew_health(0)
        with pytest.raises(RejectLostError, check=has_message(messages.UNHEALTHY)):
            await shot
        await rig.until(lambda: gate.output == 0b101)
        assert not gate.operational
        assert gate.read(0x1003, 1) == 0x8130
        await rig.io.stop()
        rig.run_belt()
        wire = rig.wire()
        try:
            for _ in range(20):
                wire.send(can.Message(arbitration_id=0x701, data=[5], is_extended_id=False))
                order = ORDER.pack(2, 1, 50, (rig.nodes.encoder.count + 10) % 2**32)
                wire.send(can.Message(arbitration_id=0x210, data=order, is_extended_id=False))
                await asyncio.sleep(0.05)
        finally:
            wire.shutdown()
        assert gate.output == 0b101
        assert not gate.fired
        await rig.io.start()
        await rig.ready()
        await rig.until(lambda: gate.read(0x1001) == 0)
        assert gate.output == 0
        assert not gate.fired
        (lost,) = rig.io.reject_faults
        assert messages.GATE_LOST.id in lost.ids()

    on_bus(scenario, safe_output=0b101)


def test_a_loop_that_hangs_sends_no_heartbeat(on_bus):
    """The lease is for ever, and yet a station that makes no progress is silent."""

    async def scenario(rig):
        await rig.ready()
        wire = rig.wire()
        try:
            await asyncio.sleep(0.2)
            while wire.recv(0) is not None:
                pass
            seen = []
            for _ in range(4):  # blocks the loop
                message = wire.recv(0.2)
                seen.append(message and message.arbitration_id)
            assert 0x701 not in seen[1:]
        finally:
            wire.shutdown()

    on_bus(scenario)


@pytest.mark.parametrize(
    ("fault", "name"), [("gate_silent", messages.GATE(node=16)), ("encoder_silent", messages.ENCODER(node=17))]
)
def test_a_lost_node_is_named_and_found_again(on_bus, fault, name):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set(fault)
        await rig.until(lambda: rig.io.why_not_ready == messages.SILENT(node=name))
        with pytest.raises(NotReadyError, check=has_message(messages.SILENT)):
            await rig.io.divert(1, 1, 5000)
        rig.faults.clear()
        await rig.until(lambda: rig.io.ready)
        assert rig.io.counters["nodes_lost"] == 1
        assert rig.io.counters["bring_ups"] == 2
        assert rig.io.bus_faults == ()

    on_bus(scenario)


def test_a_node_that_restarts_is_configured_anew(on_bus):
    async def scenario(rig):
        await rig.ready()
        gate = rig.nodes.gate
        gate.boot()
        assert gate.read(0x6207, 1) == 1
        await rig.until(lambda: rig.io.counters["bring_ups"] == 2)
        await rig.until(lambda: rig.io.ready)
        assert gate.read(0x6207, 1) == 2
        assert rig.io.counters["nodes_lost"] == 1

    on_bus(scenario, safe_output=2)


def test_a_count_that_is_not_renewed_is_unknown(on_bus):
    """The encoder lives and sends no counts, as one whose PDO another master has switched off."""

    async def scenario(rig):
        await rig.ready()
        encoder = rig.nodes.encoder
        encoder.write(0x1800, 5, 60_000)
        await rig.until(lambda: rig.io.encoder_count() is None)
        assert rig.io.why_not_ready == messages.NO_COUNT()
        await rig.until(lambda: any(messages.COUNT_LOST.id in fault.ids() for fault in rig.io.bus_faults))
        encoder.write(0x1800, 5, 10)
        encoder._due_s = 0.0  # it would only look at its timer when that is over
        await rig.until(lambda: rig.io.ready and rig.io.bus_faults == ())
        assert rig.io.counters["bring_ups"] == 1

    on_bus(scenario)


def test_an_emergency_is_named_and_goes_with_its_reset(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("overload")
        await rig.until(lambda: not rig.io.ready)
        overload = messages.EMERGENCY(
            node=messages.GATE(node=16),
            what=messages.CURRENT_HIGH(),
            code="0x2310",
            register="0x03",
            remedy=messages.DO_FLAP(),
        )
        assert rig.io.why_not_ready == overload
        assert rig.io.bus_faults == (overload,)
        assert rig.io.counters["emergencies"] == 1
        rig.faults.clear()
        await rig.until(lambda: rig.io.ready)
        assert rig.io.bus_faults == ()

    on_bus(scenario)


def test_an_error_reset_clears_only_where_the_error_register_is_0(on_bus):
    """CiA 301, 7.2.7: with code 0 and a register that is not 0, one error has gone and others remain."""

    async def scenario(rig):
        await rig.ready()
        wire = rig.wire()

        def send(node, code, register):
            data = struct.pack("<HB5x", code, register)
            wire.send(can.Message(arbitration_id=0x80 + node, data=data, is_extended_id=False))

        def codes():
            return [fault.parameters["code"] for fault in rig.io.bus_faults]

        try:
            send(16, 0x2310, 3)
            send(16, 0x0000, 3)
            send(17, 0x8250, 17)
            await rig.until(lambda: "0x8250" in codes())
            assert codes() == ["0x2310", "0x8250"]
            send(16, 0x0000, 0)
            await rig.until(lambda: codes() == ["0x8250"])
            send(17, 0x0000, 0)
            await rig.until(lambda: rig.io.ready)
        finally:
            wire.shutdown()

    on_bus(scenario)


def test_an_error_from_before_the_start_is_asked_for(on_bus):
    async def scenario(rig):
        rig.faults.set("overload")
        await rig.until(lambda: rig.nodes.gate.read(0x1001))
        await rig.io.start()
        rig.io.renew_health(40)
        await rig.until(lambda: rig.io.counters.get("bring_ups"))
        await rig.until(lambda: messages.CURRENT_HIGH.id in rig.io.why_not_ready.ids())
        rig.faults.clear()
        await rig.until(lambda: rig.io.ready)

    on_bus(scenario, start=False)


def test_bus_off_is_counted_and_the_bus_is_brought_up_again(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.faults.set("bus_off")
        await rig.until(lambda: rig.io.counters.get("bus_off") == 1)
        await rig.until(lambda: rig.io.counters["bring_ups"] == 2)
        await rig.until(lambda: rig.io.ready)

    on_bus(scenario)


def test_the_pause_before_a_bring_up_begins_anew_after_each_that_succeeded(on_bus, monkeypatch):
    pauses, sleep = [], asyncio.sleep

    async def recorded(delay_s):
        if delay_s > 0.1:  # longer than every period of the driver and the nodes
            pauses.append(delay_s)
        await sleep(delay_s)

    async def scenario(rig):
        await rig.ready()
        for times in (1, 2, 3):
            rig.faults.set("bus_off")
            await rig.until(lambda times=times: rig.io.counters["bring_ups"] >= 1 + times)
            await rig.until(lambda: rig.io.ready)
            rig.faults.clear("bus_off")
        assert pauses == [0.11, 0.11, 0.11]

    monkeypatch.setattr("asyncio.sleep", recorded)
    # A machine that stalls for a second must not lose a node, which has a pause of its own.
    on_bus(scenario, retry_s=0.11, heartbeat_lost_s=10.0, count_stale_s=5.0)


def test_a_bus_that_stays_off_is_said(on_bus):
    async def scenario(rig):
        await rig.ready()
        wire = rig.wire()
        off = can.Message(arbitration_id=0x40, is_error_frame=True, is_extended_id=False, dlc=8)

        def bus_off_reported():
            # At each look, as the bus may have been brought up between one frame and the next.
            wire.send(off)
            return not rig.io.ready and messages.BUS_OFF.id in {fault.id for fault in rig.io.bus_faults}

        try:
            await rig.until(lambda: bus_off_reported() and rig.io.counters["bus_off"] >= 3)
        finally:
            wire.shutdown()
        await rig.until(lambda: rig.io.ready)

    on_bus(scenario)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_receiving_thread_that_ends_is_noticed(on_bus):
    async def scenario(rig):
        await rig.ready()

        def end(_timeout_s):
            raise SystemExit

        rig.io._link._bus.recv = end
        await rig.until(lambda: (rig.io.why_not_ready or UP).id == messages.DEAF.id)
        await rig.until(lambda: rig.io.ready)
        assert rig.io.counters["bring_ups"] == 2

    on_bus(scenario, retry_s=0.3)


def test_a_bus_that_fails_to_receive_is_reopened_and_one_bad_frame_is_forgiven(on_bus):
    async def scenario(rig):
        await rig.ready()
        bus = rig.io._link._bus
        receive, failures = bus.recv, iter([can.CanOperationError("could not unpack received message")])

        def once(timeout_s):
            for failure in failures:
                raise failure
            return receive(timeout_s)

        bus.recv = once
        await rig.until(lambda: rig.io.counters.get("receive_errors") == 1)
        await asyncio.sleep(0.1)
        assert rig.io.counters["bring_ups"] == 1

        def always(_timeout_s):
            raise can.CanOperationError("the interface went down")

        bus.recv = always
        await rig.until(lambda: (rig.io.why_not_ready or UP).id == messages.NOT_RECEIVING.id)
        await rig.until(lambda: rig.io.ready)
        assert rig.io.counters["receive_errors"] == 11

    on_bus(scenario, retry_s=0.3)


def test_frames_of_no_sense_are_counted_and_change_nothing(on_bus):
    async def scenario(rig):
        rig.faults.set("garbage")
        await rig.ready()
        brought_up = rig.io.counters["bring_ups"]
        await rig.until(lambda: rig.io.counters.get("frames_malformed", 0) > 12)
        shot = await rig.order(1, 400)
        rig.run_belt()
        assert (await shot).sequence == 1
        assert rig.io.counters["bring_ups"] == brought_up
        assert rig.io.bus_faults == ()

    on_bus(scenario)


def test_the_gate_names_an_order_of_the_wrong_length(on_bus):
    async def scenario(rig):
        await rig.ready()
        rig.io._link.send(0x210, struct.pack("<H", 3))
        await rig.until(lambda: any(messages.WRONG_LENGTH.id in fault.ids() for fault in rig.io.bus_faults))
        assert not rig.nodes.gate.fired

    on_bus(scenario)


def test_a_bug_is_logged_and_does_not_end_the_driver(on_bus, monkeypatch, caplog):
    async def scenario(rig):
        def broken(*_):
            raise ZeroDivisionError

        with monkeypatch.context() as patch:
            patch.setattr("plc_interface.outputs.can.bring_up.verify_identity", broken)
            rig.io.renew_health(40)
            await rig.until(lambda: rig.io.why_not_ready == messages.DRIVER_FAILED())
        await rig.until(lambda: rig.io.ready)
        assert "ZeroDivisionError" in caplog.text

    on_bus(scenario)


def test_a_station_that_falls_ill_during_the_bring_up_ends_it_and_blames_nobody(on_bus):
    async def scenario(rig):
        rig.faults.set("gate_silent")
        rig.io.renew_health(40)
        await rig.until(lambda: rig.io._link)
        rig.io.renew_health(0)
        await rig.until(lambda: rig.io._link is None)
        assert rig.io.bus_faults == ()
        assert "bring_up_failures" not in rig.io.counters
        rig.faults.clear()
        await rig.ready()

    on_bus(scenario)


def test_stopping_in_the_middle_of_the_bring_up_leaves_nothing(on_bus):
    async def scenario(rig):
        for delay_s in (0.0, 0.02, 0.1, 0.3):
            await rig.io.start()
            rig.io.renew_health(40)
            await asyncio.sleep(delay_s)
            await rig.io.stop()
            assert rig.io.why_not_ready == messages.NOT_STARTED()
        await rig.io.stop()

    on_bus(scenario, start=False)
