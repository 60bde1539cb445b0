"""The faults that the PLC interface reports with its beats: alarms, and what the maintenance page shows."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.line import Line, LineFault
from station.channel.panel_maintenance_queries import GetRegisters
from station.inspection.alarm_table import AlarmId
from station.messages.line import JOURNAL_NOT_WRITTEN
from station.messages.message import verbatim
from station.runtime.production.plc_commands import PlcCommands
from station.runtime.rpc import maintenance
from station.runtime.rpc.maintenance import PanelMaintenance

ALARMS = {
    "journal": AlarmId.PLC_JOURNAL_NOT_WRITABLE,
    "can": AlarmId.CAN_NODE_LOST,
    "reject": AlarmId.GATE_NOT_FIRED,
}


@pytest.fixture
def shown():
    """The alarms as last updated."""
    return {}


@pytest.fixture
def commands(shown):
    """The PLC commands of a station that is not there."""
    service: Any = SimpleNamespace(alarms=SimpleNamespace(update=shown.__setitem__))
    metrics = SimpleNamespace(heard=lambda _: None, waiting=lambda _: None)
    observability: Any = SimpleNamespace(metrics=metrics, audit=None)
    nothing: Any = None
    return PlcCommands(service, nothing, nothing, nothing, nothing, observability)


@pytest.fixture
def beat(commands):
    """Gives the station a beat with faults."""

    def given(*faults):
        commands.set_line(
            Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=tuple(faults))
        )
        commands.update_line_alarms()

    return given


@pytest.mark.parametrize("part", ALARMS)
def test_a_fault_of_the_interface_is_an_alarm_until_it_is_gone(shown, beat, part):
    what = JOURNAL_NOT_WRITTEN(file="plc/journal.json", error="Read-only file system")
    beat(LineFault(part=part, what=what))
    assert {alarm: detail for alarm, detail in shown.items() if detail is not None} == {ALARMS[part]: what}
    beat()
    assert set(shown.values()) == {None}


def test_a_fault_of_the_handshake_is_the_plcs_and_no_alarm(shown, beat):
    beat(LineFault(part="handshake", what=verbatim("the PLC did not reset its trigger bit")))
    assert set(shown.values()) == {None}


def test_the_page_of_the_registers_gets_the_handshakes_faults_alone(commands, beat, monkeypatch):
    monkeypatch.setattr(maintenance, "REGISTERS_DEADLINE_S", 0.0)
    page = PanelMaintenance.__new__(PanelMaintenance)
    page._plc_commands = commands

    def faults():
        return asyncio.run(page.registers(GetRegisters())).faults

    assert faults() == ()
    what = verbatim("the PLC did not reset its trigger bit")
    beat(LineFault(part="handshake", what=what), LineFault(part="journal", what=verbatim("the disk is full")))
    assert faults() == (what,)
    beat()
    assert faults() == ()
