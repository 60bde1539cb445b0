"""Alarms: the table, their life, what a flood and a restart do to them."""

from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.alarm_table import ALARMS, AlarmId, Priority, urgency
from station.inspection.alarms import (
    CAUSED,
    CHATTER_S,
    LATCHED_LIFE,
    LIFE,
    LONGEST_SHELVED_S,
    SHELVES,
    Alarm,
    AlarmEvent,
    Alarms,
    AlarmState,
)
from station.inspection.cycle import TABLE, Raise
from station.messages.message import verbatim

LOW, STOP = AlarmId.DISK_LOW, AlarmId.PROTECTIVE_STOP


def test_every_alarm_asks_for_an_action_and_has_a_bit_of_its_own():
    assert list(ALARMS) == list(AlarmId)
    numbers = [row.number for row in ALARMS.values()]
    assert numbers == sorted(set(numbers))
    assert numbers[0] == 1
    for alarm, row in ALARMS.items():
        for text in map(str, (row.cause, row.consequence, row.action)):
            assert text[0].isupper(), alarm
            assert text.endswith("."), alarm
    counts = [sum(row.priority == priority for row in ALARMS.values()) for priority in Priority]
    assert counts[0] <= 3
    assert counts[0] + counts[1] <= len(ALARMS) / 3


def test_the_cycle_raises_alarms_that_a_person_must_end_only_where_one_is_needed():
    raised = {action.alarm for t in TABLE.values() for action in t.actions if isinstance(action, Raise)}
    of_devices = {AlarmId.ARM_NOT_REMOTE}  # a stop on the pendant has local control's, which stays active, not latched
    assert {alarm for alarm, row in ALARMS.items() if row.latched} == raised - {AlarmId.DEADLINE_MISSED} - of_devices


def test_the_common_life():
    alarms = Alarms().raise_(LOW, 10.0, verbatim("2 GB left"))
    assert (alarms.get(LOW).state, alarms.get(LOW).since_s) == (AlarmState.UNACKNOWLEDGED, 10.0)
    assert alarms.raise_(LOW, 20.0, verbatim("1 GB left")).get(LOW).since_s == 10.0
    assert alarms.raise_(LOW, 20.0, verbatim("1 GB left")).get(LOW).detail == verbatim("1 GB left")
    returned = alarms.returned(LOW, 30.0)
    assert returned.get(LOW).state == AlarmState.RETURNED
    assert [alarm.id for alarm in returned.annunciated()] == [LOW]
    assert (returned.active, returned.word) == ((), 0)
    assert returned.acknowledge(LOW).annunciated() == ()
    assert alarms.acknowledge(LOW).returned(LOW, 30.0).tick(200.0).known == {}


def test_a_latched_alarm_stands_until_a_person_resets_it():
    stopped = Alarms().raise_(STOP, 1.0, verbatim("joint 3"))
    assert stopped.reset(STOP) == stopped
    assert stopped.shelve(STOP, 1.0, 60.0, "anna") == stopped
    gone = stopped.acknowledge(STOP).returned(STOP, 2.0)
    assert gone.get(STOP).state == AlarmState.LATCHED
    assert gone.word == 0b10
    assert gone.acknowledge_returned().tick(1e6).word == 0b10
    assert gone.reset(STOP).word == 0
    assert gone.raise_(STOP, 3.0, verbatim("again")).get(STOP).state == AlarmState.UNACKNOWLEDGED


def test_shelving_hides_for_a_time_and_no_longer():
    shelved = Alarms().raise_(LOW, 0.0, None).shelve(LOW, 10.0, 600.0, "anna")
    assert (shelved.get(LOW).state, shelved.get(LOW).shelved_by) == (AlarmState.SHELVED, "anna")
    assert (shelved.annunciated(), shelved.word, shelved.error_code) == ((), 0, 0)
    assert shelved.tick(609.0).annunciated() == ()
    back = shelved.tick(611.0).get(LOW)
    assert (back.state, back.shelved_until_s, back.shelved_by) == (AlarmState.UNACKNOWLEDGED, None, "")
    long = Alarms().raise_(LOW, 0.0, None).shelve(LOW, 0.0, 1e9, "anna").get(LOW)
    assert long.shelved_until_s == LONGEST_SHELVED_S
    # A clock set back by days shows it again instead of hiding it for days.
    assert shelved.tick(-1e6).get(LOW).state == AlarmState.UNACKNOWLEDGED
    assert shelved.returned(LOW, 20.0).tick(611.0).known == {}


def test_a_chattering_alarm_is_told_once_and_counted():
    alarms = Alarms()
    for second in range(10):
        alarms = alarms.raise_(LOW, second, None).tick(second).acknowledge(LOW).returned(LOW, second + 0.5)
    chattering = alarms.get(LOW)
    assert (chattering.state, chattering.raised, chattering.since_s) == (AlarmState.ACKNOWLEDGED, 10, 2.0)
    assert alarms.tick(9.5 + CHATTER_S - 1).get(LOW).state == AlarmState.ACKNOWLEDGED
    assert alarms.tick(9.5 + CHATTER_S).get(LOW).state == AlarmState.NORMAL


def test_a_reset_ends_a_stop_that_chattered_once_its_cause_is_gone():
    alarms = Alarms()
    for second in range(5):
        alarms = alarms.raise_(STOP, second, None)
        assert alarms.reset(STOP).get(STOP).state == AlarmState.UNACKNOWLEDGED, "its cause is there"
        alarms = alarms.returned(STOP, second + 0.5)
    assert alarms.get(STOP).state == AlarmState.UNACKNOWLEDGED, "it chatters"
    alarms = alarms.reset(STOP)
    assert alarms.get(STOP).state == AlarmState.NORMAL
    for second in range(5, 75):
        alarms = alarms.tick(second)
        assert alarms.get(STOP).state == AlarmState.NORMAL
    alarms = alarms.raise_(STOP, 75.0, None)
    assert alarms.get(STOP).state == AlarmState.UNACKNOWLEDGED
    assert alarms.returned(STOP, 76.0).get(STOP).state == AlarmState.LATCHED_UNACKNOWLEDGED


def test_the_most_urgent_comes_first_then_the_oldest():
    alarms = Alarms()
    for second, alarm in enumerate((LOW, AlarmId.CAMERA_LOST, AlarmId.ARM_LINK_LOST, STOP)):
        alarms = alarms.raise_(alarm, float(second), None)
    assert [a.id for a in alarms.annunciated()] == [STOP, AlarmId.CAMERA_LOST, AlarmId.ARM_LINK_LOST, LOW]
    assert alarms.error_code == ALARMS[STOP].number
    assert alarms.word == sum(
        1 << (ALARMS[a].number - 1) for a in (LOW, STOP, AlarmId.CAMERA_LOST, AlarmId.ARM_LINK_LOST)
    )
    assert min(AlarmId, key=urgency) == AlarmId.EMERGENCY_STOP


@pytest.mark.parametrize("life", [LIFE, LATCHED_LIFE])
def test_from_every_state_there_is_a_way_to_normal_and_no_row_is_dead(life):
    reached, todo = set(), [AlarmState.NORMAL]
    while todo:
        state = todo.pop()
        if state not in reached:
            reached.add(state)
            todo.extend(after for (before, _), after in life.items() if before == state)
    assert reached == {state for state, _ in life}
    home, size = {AlarmState.NORMAL}, 0
    while size != len(home):
        size = len(home)
        home |= {before for (before, _), after in life.items() if after in home}
    assert home == reached


STEPS = st.lists(
    st.tuples(st.sampled_from(list(AlarmEvent)), st.sampled_from([LOW, STOP, AlarmId.CAMERA_LOST]), st.floats(-5, 90)),
    max_size=40,
)


def played(steps):
    """Alarms after some events, the causes that stand, and the time."""
    alarms, causes, now = Alarms(), set(), 1000.0
    for event, alarm, later in steps:
        now += later
        if event == AlarmEvent.RAISED:
            alarms = alarms.raise_(alarm, now, verbatim("seen"))
            causes.add(alarm)
        elif event == AlarmEvent.RETURNED:
            alarms = alarms.returned(alarm, now)
            causes.discard(alarm)
        elif event == AlarmEvent.SHELVED:
            alarms = alarms.shelve(alarm, now, later, "anna")
        else:
            verbs = {
                AlarmEvent.ACKNOWLEDGED: alarms.acknowledge,
                AlarmEvent.UNSHELVED: alarms.unshelve,
                AlarmEvent.RESET: alarms.reset,
            }
            alarms = verbs[event](alarm)
        alarms = alarms.tick(now)
    return alarms, causes, now


@given(STEPS)
def test_what_stands_is_never_forgotten_and_what_is_over_ends(steps):
    alarms, causes, now = played(steps)
    for alarm in causes:
        assert alarms.get(alarm).state in CAUSED
    for alarm in set(AlarmId) - causes:
        alarms = alarms.returned(alarm, now)
    later = alarms.tick(now + LONGEST_SHELVED_S + CHATTER_S)
    for alarm in set(AlarmId) - causes:
        assert later.get(alarm).state not in CAUSED
        assert later.get(alarm).state not in SHELVES
    ended = later
    for alarm in AlarmId:
        ended = ended.returned(alarm, 1e9).tick(2e9).acknowledge(alarm).reset(alarm)
    assert ended.tick(3e9).known == {}


@given(STEPS)
def test_stored_rows_give_the_same_alarms(steps):
    alarms, _, _ = played(steps)
    assert Alarms.restored(row(alarm) for alarm in alarms.known.values()) == alarms


def test_what_was_remembered_by_another_version_is_left_out():
    good = Alarms().raise_(LOW, 5.0, verbatim("x"))
    rows = [
        row(good.get(LOW)),
        {"id": "no_such_alarm", "state": "unacknowledged"},
        {"id": "protective_stop", "state": "shelved"},
        {"id": "reject_rate", "state": "normal", "since_s": float("nan")},
        {"id": "reject_rate", "state": "normal", "colour": "red"},
    ]
    assert Alarms.restored(rows) == good


def row(alarm: Alarm) -> dict[str, object]:
    return {each.name: getattr(alarm, each.name) for each in fields(alarm)}
