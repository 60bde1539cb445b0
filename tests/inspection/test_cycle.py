"""The cycle's table, proven by walking through every world that it can lead to."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import (
    LATCHES,
    REASONS,
    ROWS,
    START,
    STOPPED_FOR_A_PERSON,
    TABLE,
    Action,
    Cycle,
    Event,
    Raise,
    hold_after,
)
from station.inspection.states import STATES, State
from station.vocabulary import PackmlState, Refusal

READY = {State.IDLE, State.RETREATING_READY}


def test_every_state_is_told_and_reached(cycle_model):
    assert set(STATES) == set(State)
    assert {world.state for world in cycle_model} == set(State)
    for state, facts in STATES.items():
        assert str(facts.reason).endswith("."), state
        assert (facts.refusal is None) == (state in READY)
        assert not facts.needs_person or "confirm" in str(facts.reason)


def test_who_waits_is_told_of_an_inspection_under_way_that_it_has_to_end():
    for facts in STATES.values():
        assert (facts.reason == facts.activity) is (facts.refusal is not Refusal.BUSY)


def test_no_row_is_dead_and_none_is_there_twice(cycle_model):
    reached = {(world.state, event) for world, events in cycle_model.items() for event in events}
    assert set(TABLE) <= reached
    assert len(TABLE) == sum(len(row.states) * len(row.events) for row in ROWS)


def test_a_trigger_has_one_outcome_and_it_is_recorded_before_it_is_told(cycle_model):
    # `BrokenError` is raised while the model is made; here what only the whole shows.
    for world, events in cycle_model.items():
        if world.state in READY:
            assert world.accepted == 0, world
            assert world.jaws_open, world
        for event, following in events.items():
            answered = world.accepted and not following.accepted
            if answered and event != Event.UNFINISHED_CLOSED:
                assert Action.PUBLISH in TABLE[world.state, Event(event)].actions


def test_a_fruit_is_carried_only_to_its_place(cycle_model):
    # Jaws that may be closed: the arm's only motion is the one that places the fruit, after its record.
    placing = {(s, e): t for (s, e), t in TABLE.items() if {Action.PLACE_ACCEPT, Action.PLACE_REJECT} & set(t.actions)}
    assert {event for _, event in placing} == {Event.RECORDED}
    assert placing[State.RECORDING_ACCEPT, Event.RECORDED].actions == (Action.PUBLISH, Action.PLACE_ACCEPT)
    assert placing[State.RECORDING_REJECT, Event.RECORDED].actions == (Action.PUBLISH, Action.PLACE_REJECT)
    assert {state for (state, _), t in TABLE.items() if t.state == State.RECORDING_ACCEPT} <= {
        State.JUDGING,
        State.RECORDING_ACCEPT,
    }


def test_from_everywhere_there_is_a_way_back_to_ready(cycle_model):
    ready = {world for world in cycle_model if world.state == State.IDLE}
    alone = backwards(cycle_model, ready, without={Event.PERSON_CONFIRMED})
    with_a_person = backwards(cycle_model, ready, without=set())
    assert with_a_person == set(cycle_model)
    for world in set(cycle_model) - alone:
        assert waits_for_a_person(world), world


def backwards(model, goals, without):
    """The worlds from which a goal is reached by events alone: a crash does not count."""
    before = {}
    for world, events in model.items():
        for event, following in events.items():
            if event in set(Event) - set(without):
                before.setdefault(following, set()).add(world)
    found, todo = set(goals), list(goals)
    while todo:
        for world in before.get(todo.pop(), set()) - found:
            found.add(world)
            todo.append(world)
    return found


def waits_for_a_person(world):
    """A safety stop is active, or by the state itself only a person leads on."""
    return world.stopped_for_a_person or STATES[world.state].needs_person


def test_a_safety_stop_is_left_only_by_a_person():
    leaving = {e for (s, e), t in TABLE.items() if s == State.LATCHED and t.state != State.LATCHED}
    assert leaving == {Event.PERSON_CONFIRMED}
    for state in set(State) - {State.LATCHED}:
        for event, alarm in LATCHES.items():
            transition = TABLE[state, event]
            assert Raise(alarm) in transition.actions
            assert transition.state in (State.LATCHED, State.RECORDING_LATCHED)
            if state != State.RECORDING_LATCHED:
                assert Action.HALT in transition.actions


@pytest.mark.parametrize("event", [Event.ARM_FAULT, Event.GRIPPER_FAULT, Event.INTERNAL_FAULT, Event.RECORDS_FAULT])
def test_no_state_is_without_an_answer_to_a_fault(event):
    assert {state for state in State if (state, event) not in TABLE} == set()


def test_a_fruit_away_from_its_place_is_taken_out_by_a_person():
    for state in (State.PLACING_ACCEPT, State.PLACING_REJECT):
        for event in (Event.ARM_FAULT, Event.GRIPPER_FAULT, Event.INTERNAL_FAULT):
            assert TABLE[state, event].state == State.CARRIED
    assert Cycle(hold=Event.FRUIT_HELD).state == State.CARRIED
    leaving = {e for (s, e), t in TABLE.items() if s == State.CARRIED and t.state not in (State.CARRIED, State.LATCHED)}
    assert leaving == {Event.PERSON_CONFIRMED}


def test_after_a_fault_nothing_moves_before_the_devices_were_read():
    for (state, event), transition in TABLE.items():
        if transition.state == State.HELD and state != State.HELD:
            assert transition.actions[-1] == Action.READ_DEVICES, (state, event)
        if transition.state == State.CLEARING and state != State.CLEARING:
            assert event == Event.READY, state


def test_what_closes_an_inspection_has_a_reason():
    closing = {event for (_, event), t in TABLE.items() if Action.CLOSE_AS_NO_RESULT in t.actions}
    assert closing == set(REASONS)


def test_a_state_that_may_end_the_process_has_no_inspection_under_way(cycle_model):
    for state, facts in STATES.items():
        if facts.may_exit:
            assert facts.refusal != Refusal.BUSY, state
    moving = {t.state for t in TABLE.values() if {Action.GO_HOME, Action.OPEN_JAWS, Action.CLOSE_STEP} & set(t.actions)}
    assert not any(STATES[state].may_exit for state in moving)


def test_an_orderly_stop_ends_everywhere_without_a_person(cycle_model):
    ends = {world for world in cycle_model if STATES[world.state].may_exit}
    assert backwards(cycle_model, ends, without={Event.PERSON_CONFIRMED, Event.TRIGGER}) == set(cycle_model)


GOOD = [
    Event.READY, Event.UNFINISHED_CLOSED, Event.RESET, Event.JAWS_OPEN, Event.HOME, Event.READY,
    Event.TRIGGER, Event.TRIGGER_RECORDED, Event.JAWS_OPEN, Event.ARRIVED, Event.ONSET_FOUND, Event.REACHED,
    Event.SETTLED, Event.CAPTURED, Event.REACHED, Event.MEASURED, Event.SETTLED, Event.LAST_CAPTURED, Event.MEASURED,
    Event.JUDGED_ACCEPT, Event.RECORDED, Event.PLACED, Event.HOME, Event.READY,
]  # fmt: skip


def test_one_fruit_from_start_to_ready_again():
    cycle = Cycle()
    actions = [action for event in GOOD for action in cycle.on(event) or ()]
    assert cycle.state == State.IDLE
    assert cycle.facts.packml == PackmlState.IDLE
    assert not cycle.refused
    counted = Counter(actions)
    assert counted[Action.MEASURE] == counted[Action.CAPTURE] == 2
    assert counted[Action.PUBLISH] == counted[Action.RECORD] == counted[Action.ACCEPT_TRIGGER] == 1
    assert actions.index(Action.RECORD) < actions.index(Action.PUBLISH)


AGAIN = [
    Event.OFF_MIDDLE, Event.JAWS_OPEN, Event.CENTRED, Event.ONSET_FOUND, Event.REACHED, Event.SETTLED,
    Event.LAST_CAPTURED, Event.MEASURED, Event.PRESS_AGAIN, Event.JAWS_OPEN, Event.CENTRED,
]  # fmt: skip


def test_a_fruit_is_centred_and_looked_at_again_within_one_inspection():
    cycle, onset = Cycle(), GOOD.index(Event.ONSET_FOUND)
    actions = [action for event in (*GOOD[:onset], *AGAIN, *GOOD[onset:]) for action in cycle.on(event) or ()]
    assert (cycle.state, cycle.refused) == (State.IDLE, Counter())
    counted = Counter(actions)
    assert counted[Action.CLOSE_TO_ONSET] == 3
    assert counted[Action.CENTRE] == 2
    assert counted[Action.CHECK_JAWS] == counted[Action.PUBLISH] == counted[Action.RECORD] == 1
    for place in (place for place, action in enumerate(actions) if action == Action.CENTRE):
        assert actions[place - 1] == Action.FREE_FRUIT, "the arm moves with open jaws alone"


@pytest.mark.parametrize("state", [State.OPENING_AGAIN, State.CENTRING])
def test_between_two_closings_a_disturbance_ends_the_inspection_as_no_result(state):
    for event in set(REASONS) - {Event.NO_ONSET, Event.REFERENCE_BAD}:
        transition = TABLE[state, event]
        assert transition.actions[:3] == (Action.HALT, Action.CLOSE_AS_NO_RESULT, Action.RECORD), event
    for event in (Event.STOP, Event.CALLED_OFF, Event.LATE, Event.CAMERA_FAULT):
        assert TABLE[state, event].state == State.RECORDING_RELEASE
    for event in (Event.ARM_FAULT, Event.GRIPPER_FAULT):
        assert TABLE[state, event].state == State.RECORDING_HELD


def test_the_next_step_is_made_while_an_image_is_measured_but_never_two_ahead():
    transition = TABLE[State.CAPTURING, Event.CAPTURED]
    assert transition.actions == (Action.MEASURE, Action.CLOSE_STEP)
    assert TABLE[State.CAPTURING_MEASURING, Event.CAPTURED].actions == ()


@given(st.lists(st.sampled_from(list(Event)), max_size=60))
def test_any_events_are_taken_without_an_error_and_the_unlisted_are_counted(events):
    cycle = Cycle()
    refused = 0
    for event in events:
        before = cycle.state
        if cycle.on(event) is None:
            refused += 1
            assert cycle.state == before
    assert cycle.refused.total() == refused


def test_a_start_begins_with_what_only_a_person_may_end():
    for event, alarm in {**LATCHES, Event.FRUIT_HELD: AlarmId.FRUIT_HELD}.items():
        cycle = Cycle(hold=event)
        assert cycle.facts.needs_person, event
        assert cycle.begin.actions == (Action.HALT, Raise(alarm))


def test_what_needs_a_person_is_held_before_it_is_shown_and_until_the_person_ends_it():
    for (state, event), transition in TABLE.items():
        hold = hold_after(event, transition.state, None, carries=True)
        if STATES[transition.state].needs_person and state not in STOPPED_FOR_A_PERSON:
            assert hold is not None, (state, event)
            assert STATES[Cycle(hold).state].needs_person
    assert hold_after(Event.RECORDED, State.PLACING_ACCEPT, None, carries=True) == Event.FRUIT_HELD
    assert hold_after(Event.RECORDED, State.PLACING_ACCEPT, None, carries=False) is None
    assert hold_after(Event.ARM_FAULT, State.CARRIED, None, carries=False) == Event.FRUIT_HELD
    assert hold_after(Event.EMERGENCY_STOP, State.LATCHED, Event.FRUIT_HELD, carries=True) == Event.EMERGENCY_STOP
    for left in (State.UNKNOWN, State.RETREATING_READY):
        assert hold_after(Event.PERSON_CONFIRMED, left, Event.FRUIT_HELD, carries=True) is None


def test_the_start_knows_nothing():
    assert START.state == State.UNKNOWN
    assert STATES[START.state].packml is None
    assert Cycle().on(Event.TRIGGER) is None
