"""From an open bus to two operational nodes, and what is reported where it does not get there."""

import asyncio

import pytest
from canopen.objectdictionary import eds

from plc_interface.outputs.can.line_io import LineIo
from station.messages import can as messages
from station.settings.can import CanSettings


def test_the_nodes_are_configured_and_operational(on_bus):
    async def scenario(rig):
        assert rig.io.why_not_ready == messages.UNHEALTHY()
        await rig.ready()
        gate, encoder = rig.nodes.gate, rig.nodes.encoder
        assert gate.operational
        assert encoder.operational
        assert gate.read(0x1016, 1) == 5 << 16 | 1000
        assert gate.read(0x1017) == encoder.read(0x1017) == 50
        assert (gate.read(0x6206, 1), gate.read(0x6207, 1), gate.read(0x1029, 1)) == (0xFF, 3, 0)
        assert gate.read(0x1401, 1) & 0x7FF == 0x180 + 17
        assert gate.read(0x1401, 5) == 1000
        assert encoder.read(0x1800, 5) == 10
        assert rig.io.encoder_count() is not None
        assert rig.io.bus_faults == ()
        assert rig.io.why_not_ready is None
        assert rig.io.counters["bring_ups"] == 1
        await rig.io.start()

    on_bus(scenario, station_node=5, safe_output=3)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("wrong_identity", messages.ANOTHER_DEVICE),
        ("mapping_changed", messages.ANOTHER_MAPPING),
        ("mapping_refused", messages.REFUSED),
        ("gate_silent", messages.NO_HEARTBEAT),
        ("encoder_silent", messages.NO_HEARTBEAT),
    ],
)
def test_a_node_that_is_not_right_is_named_and_taken_once_it_is(on_bus, fault, message):
    async def scenario(rig):
        rig.faults.set(fault)
        rig.io.renew_health(40)
        node = messages.ENCODER(node=17) if fault == "encoder_silent" else messages.GATE(node=16)
        await rig.until(lambda: (rig.io.why_not_ready or messages.COMING_UP()).id == message.id)
        assert rig.io.why_not_ready.parameters["node"] == node
        assert not rig.io.ready
        assert rig.io.bus_faults == (rig.io.why_not_ready,)
        assert not rig.nodes.gate.operational
        rig.faults.clear()
        await rig.until(lambda: rig.io.ready)
        assert rig.io.bus_faults == ()
        assert rig.io.counters["bring_up_failures"] >= 1

    on_bus(scenario)


def test_an_operational_gate_watches_the_station_also_where_it_goes_before_its_next_heartbeat(on_bus, monkeypatch):
    async def never(_: LineIo) -> None:
        await asyncio.Event().wait()

    async def scenario(rig):
        await rig.ready()
        await rig.until(lambda: not rig.nodes.gate.operational)

    monkeypatch.setattr(LineIo, "_beat", never)
    on_bus(scenario)


def test_the_first_order_finds_a_gate_that_has_the_encoders_count(on_bus):
    """The encoder is operational before the gate: its first count is the station's alone."""

    async def scenario(rig):
        rig.faults.set("stuck")
        await rig.ready()
        shot = await rig.order(1, 400)
        rig.run_belt()
        assert (await shot).sequence == 1
        assert rig.io.reject_faults == ()

    on_bus(scenario, encoder_period_s=0.4)


def test_no_session_parses_a_data_sheet_on_the_loop(on_bus, monkeypatch):
    """On that loop the registers are served too."""

    async def scenario(rig):
        parsed, parse = [], eds.import_eds

        def noted(sheet, node):
            parsed.append(sheet)
            return parse(sheet, node)

        monkeypatch.setattr(eds, "import_eds", noted)
        await rig.ready()
        rig.io.renew_health(0)
        await rig.until(lambda: not rig.nodes.gate.operational)
        await rig.ready()
        assert rig.io.counters["bring_ups"] == 2
        assert rig.nodes.gate.operational
        assert parsed == []

    on_bus(scenario)


def test_a_driver_that_is_not_started_is_not_ready():
    io = LineIo(CanSettings())
    assert io.why_not_ready == messages.NOT_STARTED()
    assert io.encoder_count() is None


def test_a_missing_interface_is_one_sentence_and_stays_tried(on_bus):
    async def scenario(rig):
        missing = LineIo(rig.settings.model_copy(update={"interface": "socketcan", "channel": "nocan7"}))
        await missing.start()
        try:
            missing.renew_health(40)
            await rig.until(lambda: missing.counters.get("bring_up_failures", 0) >= 2)
            assert missing.why_not_ready is not None
            assert missing.why_not_ready.id == messages.NOT_OPENED.id
            assert missing.bus_faults == (missing.why_not_ready,)
        finally:
            await missing.stop()

    on_bus(scenario, start=False)
