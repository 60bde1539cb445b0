"""Deadlines as values."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.channel.line import BeginReply
from station.errors import BadInputError
from station.inspection.cycle import TABLE, Event
from station.inspection.deadlines import FAULT_OF, LONGEST_S, Pace, deadlines, late
from station.inspection.second_press import FREED_BY_MM
from station.inspection.states import STATES, State
from station.runtime.cycle.pacing import RECORD_NO_RESULT_S
from station.settings.recipe import load_recipe
from station.vocabulary import Refusal

ROOT = Path(__file__).resolve().parents[2]
RECIPE = load_recipe(ROOT / "recipes" / "strawberry.yaml")
PACE = Pace(
    frames_per_s=30.0, arm_move_s=2.0, arm_way_s=1.5, opening_mm_s=100.0, stroke_mm=53.0, record_s=0.1, measure_s=0.05
)
WAITING = {State.UNKNOWN, State.STOPPED, State.IDLE, State.HELD, State.CARRIED, State.LATCHED}


def changed(**imaging_or_steps: object):
    """The recipe with some fields of its steps, imaging or press changed."""
    parts = {
        name: getattr(RECIPE, name).model_copy(
            update={k: v for k, v in imaging_or_steps.items() if k in type(getattr(RECIPE, name)).model_fields}
        )
        for name in ("steps", "imaging", "press")
    }
    return RECIPE.model_copy(update=parts)


def test_every_state_that_waits_for_something_has_a_deadline_that_the_cycle_answers():
    limits = deadlines(RECIPE, PACE)
    assert set(limits.phases_s) == set(State) - WAITING
    for state, event in FAULT_OF.items():
        following = TABLE[state, event].state
        assert following != state, (state, event)
        assert STATES[following].refusal is not None


def test_the_strawberrys_deadline_covers_its_motions_and_no_hours():
    limits, once = deadlines(RECIPE, PACE), deadlines(changed(attempts=1, centre_from_mm=None), PACE)
    settle_s = RECIPE.imaging.settle_s
    steps_s = 3 * (1 / 20 + settle_s + 3 / 30)
    assert 5 / 30 + PACE.arm_way_s + steps_s < once.longest_path_s < limits.longest_path_s < 15
    assert limits.longest_path_s < limits.inspection_s < 2 * limits.longest_path_s
    assert BeginReply(sequence=1, deadline_s=limits.inspection_s).refusal is None
    assert limits.phases_s[State.SETTLING] == pytest.approx(1.0 + 3 * settle_s)


MOTION_S = {
    State.APPROACHING: 4.0,
    State.CENTRING: 0.5,
    # From 53 mm down to 22 mm in steps of 1 mm, each with a motion, settling, three frames and a measurement.
    State.CLOSING_TO_ONSET: 32 * (0.25 + 0.035 + 0.1 + 0.05),
    State.MOVING: 0.25,
    State.MOVING_MEASURING: 0.3,
    State.SETTLING: 0.035,
    State.SETTLING_MEASURING: 0.035,
    State.REFERENCE: 5 / 30,
    State.CAPTURING: 0.1,
    State.CAPTURING_MEASURING: 0.1,
    State.AWAITING_MEASURE: 0.05,
    State.AWAITING_MEASURE_LAST: 0.05,
    State.MEASURING_LAST: 0.05,
    State.PLACING_ACCEPT: 3 * 2.0 + 2.85,
    State.PLACING_REJECT: 3 * 2.0 + 2.85,
    State.RECOVERING: 20.0,
    **dict.fromkeys(
        (State.RETREATING, State.RETREATING_READY, State.RETREATING_ACCEPTED, State.HOMING, State.HOMING_UNRECORDED),
        4.0,
    ),
    **dict.fromkeys(
        (State.OPENING_AGAIN, State.RELEASING, State.RESETTING, State.OPENING_HELD, State.OPENING_UNRECORDED), 2.85
    ),
    **dict.fromkeys((State.JUDGING, State.CHECKING), 0.0),
}
"""What each state takes by the strawberry's recipe where all is well; those not listed take a durable write."""


def test_a_phase_has_three_times_what_it_takes_and_a_second():
    phases_s = deadlines(RECIPE, PACE).phases_s
    assert phases_s == pytest.approx({state: 1.0 + 3.0 * MOTION_S.get(state, 0.1) for state in phases_s})


@pytest.mark.parametrize(
    ("pace", "state", "takes_s"),
    [
        ({"arm_move_s": 1.0}, State.APPROACHING, 2.85),  # the jaws are slower than the arm
        ({"arm_move_s": 1.0}, State.HOMING, 2.85),
        ({"arm_move_s": 0.3}, State.CENTRING, 0.3),
        ({"stroke_mm": 20.0}, State.CLOSING_TO_ONSET, 0.435),
        ({"record_s": 0.4}, State.CLEARING, 0.4),
    ],
)
def test_a_phase_takes_as_long_as_the_slowest_of_what_it_waits_for(pace, state, takes_s):
    limits = deadlines(RECIPE, PACE._replace(**pace))
    assert limits.phases_s[state] == pytest.approx(1.0 + 3.0 * takes_s)


def test_a_motion_through_all_limits_without_a_stop_has_their_closing_for_its_way():
    phases_s = deadlines(changed(measured="while_closing"), PACE).phases_s
    assert phases_s[State.MOVING] == pytest.approx(1.0 + 3.0 * (3.0 / 20 + 0.2))


def test_smaller_steps_take_less_each_and_are_more():
    phases_s = deadlines(changed(step_mm=0.5), PACE).phases_s
    assert phases_s[State.MOVING] == pytest.approx(1.0 + 3.0 * (0.5 / 20 + 0.2))
    assert phases_s[State.CLOSING_TO_ONSET] == pytest.approx(1.0 + 3.0 * 63 * (0.225 + 0.035 + 0.1 + 0.05))


ONSET_S = 0.2 + 4 * (0.2 + 0.05) + 3 / 30 + 0.1
"""Back to where nothing touches, four glances by one frame, then one by three."""
PRESS_S = 3 * (0.05 + 0.2 + 0.035 + 0.1) + 2 * 0.05
AGAIN_S = 2 * (FREED_BY_MM / 20 + 0.2) + ONSET_S
FIRST_S = (1.5 + 0.2) + 5 / 30 + ((53 - 22 + 1) / 20 + 0.2) + ONSET_S + PRESS_S


@pytest.mark.parametrize(
    ("recipe", "pace", "takes_s"),
    [
        ({"attempts": 1, "centre_from_mm": None}, {}, FIRST_S),
        ({"attempts": 2, "centre_from_mm": None}, {}, FIRST_S + AGAIN_S + 0.5 + PRESS_S),
        ({"attempts": 1}, {}, FIRST_S + AGAIN_S + 0.5),
        ({}, {}, FIRST_S + 2 * (AGAIN_S + 0.5) + PRESS_S),
        ({}, {"arm_way_s": 0.0}, FIRST_S - 1.5 + 0.53 + AGAIN_S + PRESS_S),
        ({"attempts": 1, "centre_from_mm": None}, {"stroke_mm": 85.0}, FIRST_S),
        ({"attempts": 1, "centre_from_mm": None}, {"stroke_mm": 300.0}, FIRST_S + 1.5),
        ({"attempts": 1, "centre_from_mm": None, "number": 2}, {}, FIRST_S - 0.385),
        ({"attempts": 1, "centre_from_mm": None, "stop_when_decided": False}, {}, FIRST_S + 9 * 0.385),
        ({"attempts": 1, "centre_from_mm": None, "step_mm": 0.5}, {}, FIRST_S - 0.5 / 20 + 6 * 0.36 - 3 * 0.385),
        ({"attempts": 1, "centre_from_mm": None}, {"measure_s": 1.0}, FIRST_S + 4 * 0.95 + 3 * 0.615 + 2 * 0.95),
    ],
)
def test_the_longest_path_is_the_sum_of_what_a_fruit_goes_through(recipe, pace, takes_s):
    limits = deadlines(changed(**recipe), PACE._replace(**pace))
    assert limits.longest_path_s == pytest.approx(takes_s)
    assert limits.inspection_s == pytest.approx(1.0 + 1.5 * takes_s)


def test_a_recipe_that_takes_the_whole_curve_has_the_time_for_it():
    decided, whole = (deadlines(changed(stop_when_decided=stops), PACE).longest_path_s for stops in (True, False))
    assert whole - decided > 2 * (RECIPE.steps.number - 3) * (1 / 20 + RECIPE.imaging.settle_s + 3 / 30)


def test_a_step_that_is_measured_before_the_next_has_the_measurements_time_too():
    limits, slow = (deadlines(RECIPE, PACE._replace(measure_s=measure_s)) for measure_s in (0.1, 1.1))
    assert slow.phases_s[State.MOVING_MEASURING] - limits.phases_s[State.MOVING_MEASURING] == pytest.approx(3.0)


def test_a_second_press_has_its_time_to_let_go_and_press_again():
    once, twice = (deadlines(changed(attempts=attempts), PACE).longest_path_s for attempts in (1, 2))
    assert twice - once > 2 * FREED_BY_MM / 20 + 3 * (1 / 20 + RECIPE.imaging.settle_s + 3 / 30)


def test_centring_has_its_time_where_there_is_an_arm():
    off, on = (changed(centre_from_mm=from_mm) for from_mm in (None, 0.4))
    assert deadlines(on, PACE).longest_path_s - deadlines(off, PACE).longest_path_s > 2 * FREED_BY_MM / 20
    bench = PACE._replace(arm_move_s=0.0, arm_way_s=0.0)
    assert deadlines(on, bench).longest_path_s == deadlines(off, bench).longest_path_s


@given(st.integers(1, 10), st.floats(0, 2), st.integers(1, 20), st.floats(0.1, 5), st.floats(15, 60), st.floats(0, 0.5))
def test_more_to_do_never_has_a_nearer_deadline(frames, settle, steps, arm, rate, measure):
    recipe = changed(frames_per_step=frames, settle_s=settle, number=steps, stop_when_decided=False)
    pace = Pace(rate, arm, arm, 53.0, 53.0, 0.1, measure)
    here = deadlines(recipe, pace)
    more = (
        deadlines(changed(frames_per_step=frames + 1, settle_s=settle, number=steps, stop_when_decided=False), pace),
        deadlines(changed(frames_per_step=frames, settle_s=settle + 1, number=steps, stop_when_decided=False), pace),
        deadlines(changed(frames_per_step=frames, settle_s=settle, number=steps + 1, stop_when_decided=False), pace),
        deadlines(recipe, pace._replace(arm_move_s=arm + 1, arm_way_s=arm + 1)),
        deadlines(recipe, pace._replace(frames_per_s=rate / 2)),
    )
    for later in more:
        assert later.inspection_s > here.inspection_s
        assert all(later.phases_s[state] >= here.phases_s[state] for state in here.phases_s)


def test_late_names_what_was_waited_for_and_the_inspection_first():
    limits = deadlines(RECIPE, PACE)
    allowed = limits.phases_s[State.MOVING]
    assert late(limits, State.MOVING, allowed, 1.0) is None
    assert late(limits, State.MOVING, allowed, limits.inspection_s) is None
    slow = late(limits, State.MOVING, allowed + 0.1, 1.0)
    assert slow is not None
    assert (slow.event, slow.state, slow.allowed_s) == (Event.GRIPPER_FAULT, State.MOVING, allowed)
    whole = late(limits, State.MOVING, allowed + 0.1, limits.inspection_s + 0.1)
    assert whole is not None
    assert whole.event == Event.LATE
    assert late(limits, State.IDLE, 1e9, None) is None
    assert late(limits, State.HELD, 1e9, None) is None


def test_a_recipe_that_takes_longer_than_the_plc_can_be_told_is_refused():
    with pytest.raises(BadInputError, match=r"recipe strawberry: an inspection may take \d+ s here.*shorter settle"):
        deadlines(changed(settle_s=10.0, number=100, stop_when_decided=False), PACE)
    assert BeginReply.model_fields["deadline_s"].metadata[1].le == LONGEST_S + RECORD_NO_RESULT_S


def test_an_inspection_may_take_exactly_what_the_plc_can_be_told(monkeypatch):
    needed_s = deadlines(RECIPE, PACE).inspection_s
    monkeypatch.setattr("station.inspection.deadlines.LONGEST_S", needed_s)
    assert deadlines(RECIPE, PACE).inspection_s == needed_s


def test_a_press_goes_on_to_the_last_of_all_limits():
    limits = RECIPE.damage.area
    further = limits[-1].model_copy(update={"closing_mm": limits[-1].closing_mm + 2.0})
    damage = RECIPE.damage.model_copy(update={"area": (*limits, further)})
    here, there = (deadlines(one, PACE) for one in (RECIPE, RECIPE.model_copy(update={"damage": damage})))
    presses, step_s = RECIPE.press.attempts, 0.05 + 0.2 + 0.035 + 0.1
    assert there.longest_path_s - here.longest_path_s == pytest.approx(presses * 2 * step_s)


def test_an_inspections_phases_are_those_in_which_the_station_is_busy():
    busy = {state for state, facts in STATES.items() if facts.refusal == Refusal.BUSY}
    assert busy <= set(FAULT_OF)
