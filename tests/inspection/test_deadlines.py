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
    assert BeginReply.model_fields["deadline_s"].metadata[1].le == LONGEST_S


def test_an_inspections_phases_are_those_in_which_the_station_is_busy():
    busy = {state for state, facts in STATES.items() if facts.refusal == Refusal.BUSY}
    assert busy <= set(FAULT_OF)
