"""The faults that the PLC interface reports with its beats: alarms, and what the maintenance page shows."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.line import Line, LineFault
from station.channel.panel_maintenance import GetRegisters
from station.inspection.alarm_table import AlarmId
from station.inspection.alarms import AlarmState
from station.messages.can import UNORDERED_REPORT
from station.messages.line import JOURNAL_NOT_WRITTEN
from station.messages.message import verbatim
from station.messages.operation import INTERFACE_SILENT
from station.runtime.alarms.manager import AlarmManager
from station.runtime.production.line_state import SILENT_S, LineState
from station.runtime.rpc import maintenance
from station.runtime.rpc.maintenance import PanelMaintenance

ALARMS = {
    "journal": AlarmId.PLC_JOURNAL_NOT_WRITABLE,
    "can": AlarmId.CAN_NODE_LOST,
    "reject": AlarmId.GATE_NOT_FIRED,
}


@pytest.fixture
def alarms():
    """The alarms of a station that is not there."""
    metrics: Any = SimpleNamespace(alarms=lambda _: None)
    return AlarmManager(metrics)


@pytest.fixture
def line_state(alarms):
    """The line state of that station."""
    metrics: Any = SimpleNamespace(heard=lambda _: None, waiting=lambda _: None)
    return LineState(alarms, metrics)


@pytest.fixture
def beat(line_state):
    """Gives the station a beat with faults."""

    def given(*faults):
        line_state.report(
            Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=tuple(faults))
        )
        line_state.update_alarms()

    return given


def active(alarms):
    return {alarm.id: alarm.detail for alarm in alarms.alarms.active}


def rejected(*sequences):
    """The faults of reject actuations that failed, in their order."""
    return tuple(LineFault(part="reject", what=UNORDERED_REPORT(sequence=sequence)) for sequence in sequences)


@pytest.mark.parametrize("part", ALARMS)
def test_a_fault_of_the_interface_is_an_alarm_until_it_is_gone(alarms, beat, part):
    what = JOURNAL_NOT_WRITTEN(file="plc/journal.json", error="Read-only file system")
    beat(LineFault(part=part, what=what))
    assert active(alarms) == {ALARMS[part]: what}
    beat()
    assert active(alarms) == {}


def test_each_fruit_that_the_gate_missed_is_announced_anew(alarms, beat):
    beat(*rejected(17))
    alarms.acknowledge(AlarmId.GATE_NOT_FIRED)
    beat(*rejected(17))
    assert active(alarms) == {}, "a person's acknowledgement ends it, although the PLC interface still reports it"
    beat(*rejected(17, 42))
    (alarm,) = alarms.alarms.active
    assert (alarm.state, alarm.detail) == (AlarmState.UNACKNOWLEDGED, UNORDERED_REPORT(sequence=42))


def test_a_fruit_that_the_gate_missed_is_announced_also_where_the_alarm_chatters(alarms, beat):
    for missed in ((17,), (17, 42), (17, 42, 43)):
        beat(*rejected(*missed))
    alarms.acknowledge(AlarmId.GATE_NOT_FIRED)
    assert active(alarms) == {}
    beat(*rejected(17, 42, 43, 51, 52))
    (alarm,) = alarms.alarms.active
    assert alarm.state == AlarmState.UNACKNOWLEDGED
    assert all(str(sequence) in str(alarm.detail) for sequence in (51, 52))


def test_a_failed_reject_that_is_reported_again_is_announced_once(alarms, beat):
    beat(*rejected(17, 42))
    beat(*rejected(17, 42, 17))
    alarms.acknowledge(AlarmId.GATE_NOT_FIRED)
    beat(*rejected(42, 17, 42))
    assert active(alarms) == {}


def test_a_fault_of_the_handshake_is_the_plcs_and_no_alarm(alarms, beat):
    beat(LineFault(part="handshake", what=verbatim("the PLC did not reset its trigger bit")))
    assert active(alarms) == {}


def test_an_interface_that_is_silent_is_an_alarm_of_its_own_and_not_the_plcs(alarms, line_state, beat):
    line_state.update_alarms()
    assert active(alarms) == {}, "one that has never beaten may not be there yet"
    beat()
    assert active(alarms) == {}
    line_state._at_s -= SILENT_S + 1
    line_state.update_alarms()
    (alarm,) = alarms.alarms.active
    assert (alarm.id, alarm.detail.id) == (AlarmId.PLC_INTERFACE_LOST, INTERFACE_SILENT.id)
    beat()
    assert active(alarms) == {}


def test_the_page_of_the_registers_gets_the_handshakes_faults_alone(line_state, beat, monkeypatch):
    monkeypatch.setattr(maintenance, "REGISTERS_DEADLINE_S", 0.0)
    page = PanelMaintenance.__new__(PanelMaintenance)
    page._line_state = line_state

    def faults():
        return asyncio.run(page.registers(GetRegisters())).faults

    assert faults() == ()
    what = verbatim("the PLC did not reset its trigger bit")
    beat(LineFault(part="handshake", what=what), LineFault(part="journal", what=verbatim("the disk is full")))
    assert faults() == (what,)
    beat()
    assert faults() == ()
