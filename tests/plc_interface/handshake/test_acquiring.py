"""The bit `acquiring`: from the acceptance until a beat reports that the station is idle."""

import pytest

from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Link
from plc_interface.handshake.view import view
from plc_interface.registers.map import BY_NAME
from station.channel.line import PACKML_STATE_NUMBERS, BeginReply, Open, PackmlState, Reason, Refusal

GETTING_READY = (None, PackmlState.CLEARING, PackmlState.STOPPED, PackmlState.RESETTING)


def status(made):
    word = view(made.state)["status"]
    assert isinstance(word, int)
    return BY_NAME["status"].names(word)


def beat(made, packml_state, **changes):
    """Feed a beat, and return the status."""
    made.beat(packml_state=packml_state, **changes)
    return status(made)


def at_rest(bench, journal=None):
    """Return a bench that is armed, with a station whose jaws are open."""
    made = bench(journal)
    made.armed()
    assert "acquiring" not in beat(made, PackmlState.IDLE)
    return made


def running(bench):
    """Return the same with an accepted trigger."""
    made = at_rest(bench)
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert {"acquiring", "inspecting"} <= status(made)
    return made


def test_a_fruit_stays_after_its_outcome_until_the_station_is_idle(bench):
    made = running(bench)
    assert "acquiring" in beat(made, PackmlState.EXECUTE)
    made.feed(ev.OutcomeReceived, made.outcome())
    assert {"acquiring", "result_valid"} <= status(made)
    assert "inspecting" not in status(made)
    for state in (PackmlState.EXECUTE, PackmlState.COMPLETING):
        assert "acquiring" in beat(made, state)
    assert "acquiring" not in beat(made, PackmlState.IDLE)


def test_the_next_trigger_need_not_wait_for_it(bench):
    made = running(bench)
    made.feed(ev.OutcomeReceived, made.outcome())
    made.write("enable", acknowledged_sequence=41)
    assert {"acquiring", "trigger_ready"} <= beat(made, PackmlState.COMPLETING)
    made.write("enable", "trigger", trigger_id=8)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=42, deadline_s=2.0))
    assert made.state.journal.accepted_id == 8


@pytest.mark.parametrize("stop", [PackmlState.ABORTING, PackmlState.ABORTED, PackmlState.HELD, PackmlState.STOPPING])
def test_a_station_that_stops_over_the_fruit_lets_none_be_moved(bench, stop):
    made = running(bench)
    made.feed(ev.OutcomeReceived, made.outcome())
    assert "acquiring" in beat(made, stop)


def test_a_station_lost_over_the_fruit_lets_none_be_moved_until_it_is_idle_again(bench):
    made = running(bench)
    beat(made, PackmlState.EXECUTE)
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    assert made.state.link is Link.LOST
    assert {"acquiring", "result_valid"} <= status(made)
    for state in GETTING_READY:
        assert "acquiring" in beat(made, state, boot="2")
    assert "acquiring" not in beat(made, PackmlState.IDLE, boot="2")


def test_a_station_lost_without_a_fruit_holds_none(bench):
    made = at_rest(bench)
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    assert made.state.link is Link.LOST
    assert "acquiring" not in status(made)
    for state in GETTING_READY:
        assert "acquiring" not in beat(made, state, boot="2")


@pytest.mark.parametrize("journal", ["of the first start", "of a run with a fruit", "of a run without one"])
def test_after_a_start_of_the_interface_nothing_is_known_until_a_beat_says_so(bench, journal):
    before = running(bench)
    if journal == "of a run without one":
        before.feed(ev.OutcomeReceived, before.outcome())
        beat(before, PackmlState.IDLE)
    made = bench(Journal() if journal == "of the first start" else before.state.journal)
    assert "acquiring" in status(made)
    if journal == "of a run with a fruit":
        made.link(Open(running=(41, 7), outcomes=()), packml_state=PackmlState.EXECUTE)
        made.feed(ev.OutcomeReceived, made.outcome())
    assert "acquiring" in beat(made, PackmlState.HELD)
    assert "acquiring" not in beat(made, PackmlState.IDLE)


@pytest.mark.parametrize("lost", ["answer", "beats", "start"])
def test_a_fruit_whose_trigger_the_station_may_have_begun_stays(bench, lost):
    made = at_rest(bench)
    made.write("enable", "trigger", trigger_id=7)
    if lost == "answer":
        made.feed(ev.BeginFailed, made.state.pending.number)
    elif lost == "beats":
        made.now_s += made.settings.station_lost_after_s
        made.feed(ev.Tick)
    else:
        beat(made, None, boot="2")
    assert made.state.last_refusal is Refusal.STATION_LOST
    assert "acquiring" in status(made)
    assert "acquiring" not in beat(made, PackmlState.IDLE, boot="2")


@pytest.mark.parametrize("beats", ["lost", "late"])
def test_what_the_station_reported_before_an_inspection_is_not_its_state_after_the_outcome(bench, beats):
    """Found by story 2214: the beats were lost, and a stop with closed jaws had `trigger_ready` beside its outcome."""
    made = at_rest(bench)
    sent_s = made.now_s
    made.now_s += 0.1
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    made.now_s += 0.1
    made.feed(ev.OutcomeReceived, made.outcome("NO_RESULT", Reason.ARM_FAULT))
    made.write("enable", acknowledged_sequence=41)
    if beats == "late":
        beat(made, PackmlState.IDLE, asked_s=sent_s)
    assert "acquiring" in status(made)
    assert "trigger_ready" not in status(made)
    assert view(made.state)["packml_state"] == PACKML_STATE_NUMBERS[PackmlState.STARTING]
    assert "trigger_ready" not in beat(made, PackmlState.ABORTED, ready=False)
    now = beat(made, PackmlState.IDLE)
    assert "trigger_ready" in now
    assert "acquiring" not in now


def test_a_fruit_whose_inspection_the_station_began_under_a_used_sequence_stays(bench):
    made = at_rest(bench, Journal(highest=41))
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert made.state.last_refusal is Refusal.NOT_READY
    assert "acquiring" in status(made)
    assert "trigger_ready" not in status(made)
    assert "acquiring" not in beat(made, PackmlState.IDLE)


@pytest.mark.parametrize("answer", ["lost", "refused"])
def test_a_trigger_that_is_not_accepted_ends_the_readiness_until_the_next_beat(bench, answer):
    made = at_rest(bench)
    made.write("enable", "trigger", trigger_id=7)
    if answer == "lost":
        made.feed(ev.BeginFailed, made.state.pending.number)
    else:
        made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(refusal=Refusal.NOT_READY))
    assert "trigger_ready" not in status(made)
    assert view(made.state)["packml_state"] == (PACKML_STATE_NUMBERS[PackmlState.IDLE] if answer == "refused" else 0)
    if answer == "lost":
        made.link(packml_state=PackmlState.IDLE)
    assert "trigger_ready" in beat(made, PackmlState.IDLE)


@pytest.mark.parametrize("state", [PackmlState.STARTING, PackmlState.EXECUTE])
def test_a_beat_that_reports_an_inspection_holds_the_fruit_whoever_began_it(bench, state):
    made = at_rest(bench)
    assert "acquiring" in beat(made, state)
    assert "inspecting" not in status(made)


def test_a_beat_from_before_the_acceptance_frees_no_fruit(bench):
    made = running(bench)
    assert "acquiring" in beat(made, PackmlState.IDLE)
    made.feed(ev.OutcomeReceived, made.outcome())
    assert "acquiring" in status(made)
