"""Alarms from the last outcomes: raised, and back to normal."""

import pytest

from station.channel.line import Outcome, Reason
from station.inspection.alarm_table import AlarmId
from station.runtime.alarms.manager import AlarmManager
from station.runtime.alarms.outcome_monitor import OutcomeMonitor
from station.runtime.observability.metrics import Metrics


@pytest.fixture
def alarms():
    return AlarmManager(Metrics("0", 1.0))


def outcome(sequence, *, late=False):
    return Outcome(
        sequence=sequence,
        trigger_id=sequence,
        outcome="NO_RESULT" if late else "PASS",
        reasons=(Reason.LATE,) if late else (),
        late=late,
        partial=late,
        simulated=True,
        area_mm2=None,
        area_px=None,
        closing_mm=None,
        confidence=None,
        recipe_number=1,
        recipe_checksum=0,
        began_utc_ms=0,
        ended_utc_ms=0,
        duration_ms=0,
        encoder=0,
        lot="",
    )


def active(alarms):
    return {alarm.id for alarm in alarms.alarms.active}


def test_a_missed_deadline_returns_to_normal_with_the_next_outcome_in_time(alarms):
    monitor = OutcomeMonitor(alarms)
    alarms.raise_(AlarmId.DEADLINE_MISSED, None)
    monitor.add(outcome(1, late=True))
    assert active(alarms) == {AlarmId.DEADLINE_MISSED}
    monitor.add(outcome(2))
    assert active(alarms) == set()
