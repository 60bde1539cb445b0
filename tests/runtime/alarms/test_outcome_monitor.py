"""Alarms from the last outcomes: raised, and back to normal."""

import pytest

from station.channel.line import Outcome, Reason
from station.inspection.alarm_table import AlarmId
from station.runtime.alarms.manager import AlarmManager
from station.runtime.alarms.outcome_monitor import OutcomeMonitor
from station.runtime.observability.metrics import Metrics
from station.vocabulary import OutcomeName


@pytest.fixture
def alarms():
    return AlarmManager(Metrics("0", 1.0))


def outcome(sequence: int, name: OutcomeName = "PASS", *, late: bool = False) -> Outcome:
    return Outcome(
        sequence=sequence,
        trigger_id=sequence,
        outcome="NO_RESULT" if late else name,
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


def test_more_than_half_of_the_last_twenty_that_fail_are_an_alarm_until_they_are_fewer(alarms):
    monitor = OutcomeMonitor(alarms)
    for sequence in range(1, 10):
        monitor.add(outcome(sequence))
    for sequence in range(10, 20):
        monitor.add(outcome(sequence, "FAIL"))
        assert active(alarms) == set()
    monitor.add(outcome(20, "FAIL"))
    assert active(alarms) == {AlarmId.REJECT_RATE}
    monitor.add(outcome(21, "NO_RESULT"))
    assert active(alarms) == {AlarmId.REJECT_RATE}, "the first that left was a PASS"
    for sequence in range(22, 31):
        monitor.add(outcome(sequence))
    assert active(alarms) == set()
