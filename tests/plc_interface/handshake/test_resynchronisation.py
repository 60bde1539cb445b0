"""A start from the journal, and what the station reports as open, settled."""

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Inspection, Link
from station.channel.line import BeginReply, Open, Reason, Refusal


def test_a_trigger_that_was_pending_at_the_end_counts_as_one_that_was_missed(bench):
    made = bench(Journal(asked_id=7))
    counters = made.state.counters
    assert (counters["count_triggers"], counters["count_missed"]) == (1, 1)
    assert sum(counters.values()) == 2
    assert (made.state.missed, made.state.last_refusal, made.state.last_refused_id) == (True, Refusal.STATION_LOST, 7)
    assert (made.state.journal.asked_id, made.state.journal.disowned) == (None, (7,))
    assert not any(bench().state.counters.values())
    full = bench(Journal(asked_id=7, disowned=tuple(range(101, 109))))
    assert full.state.journal.disowned == (*range(102, 109), 7)


def test_starts_of_the_station_are_counted_modulo_65536(bench):
    made = bench()
    made.feed(ev.WriterGranted)
    made.link()
    made.state.station_boots = 65535
    made.beat(boot="2")
    assert made.state.station_boots == 0


def test_an_inspection_that_may_be_the_pending_triggers_is_its_own_once_the_station_has_answered(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=6)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(refusal=Refusal.BUSY))
    number = made.state.open_request
    made.write("enable")
    made.write("enable", "trigger", trigger_id=7)
    pending = made.state.pending.number
    made.feed(ev.OpenAnswered, number, Open(running=(42, 7), outcomes=()))
    assert not made.of(do.NotifyPublished), "nothing is called off"
    made.feed(ev.BeginAnswered, pending, BeginReply(sequence=42, deadline_s=2.0))
    assert (made.state.running.sequence, made.state.running.trigger_id) == (42, 7)


def test_an_outcome_in_the_stations_place_has_the_fruits_size(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7, fruit_length_mm_x10=480, size_class=3)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert made.state.inspection is Inspection.RUNNING
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    (outcome,) = made.state.queue
    assert (outcome.outcome, outcome.reasons) == ("NO_RESULT", (Reason.STATION_LOST,))
    assert (outcome.fruit_length_mm_x10, outcome.size_class) == (480, 3)


def test_the_running_inspections_outcome_is_asked_for_again_after_a_lost_answer(bench):
    made = bench()
    made.run()
    (request,) = made.of(do.RequestOutcome)
    made.feed(ev.OutcomeFailed, 41, "no answer")
    made.link(Open(running=(41, 7), outcomes=()))
    assert made.of(do.RequestOutcome) == [request, request]
    assert made.state.inspection is Inspection.RUNNING


def test_a_running_inspection_that_the_station_does_not_name_any_more_is_lost_to_it(bench):
    made = bench()
    made.run()
    other = made.outcome().model_copy(update={"sequence": 40, "trigger_id": 6})
    made.feed(ev.OutcomeFailed, 41, "no answer")
    made.link(Open(running=None, outcomes=(other,)))
    assert [(each.sequence, each.reasons) for each in made.state.queue] == [(41, (Reason.STATION_LOST,))]


@pytest.mark.parametrize(("ran_s", "known_s"), [(0.5, 0.5), (-3.0, 0.0)])
def test_an_inspection_that_ran_at_the_end_waits_for_the_station_as_long_as_it_may(bench, ran_s, known_s):
    before = bench()
    before.run()
    running = before.state.running
    began_utc_ms = before.at().utc_ms - round(1000 * ran_s)  # the clock may have been set back since
    made = bench(Journal(running=running.model_copy(update={"began_utc_ms": began_utc_ms}), highest=41))
    assert made.state.running.began_s == pytest.approx(made.now_s - known_s)
    made.now_s += min(running.within_s, made.settings.station_lost_after_s)
    made.feed(ev.Tick)
    (outcome,) = made.state.queue
    assert (outcome.sequence, outcome.outcome) == (41, "NO_RESULT")


def test_an_inspection_that_was_called_off_is_never_the_next_fruits(bench):
    """Its trigger's answer was lost with the interface, and the PLC uses the refused id again."""
    made = bench(Journal(asked_id=7, highest=40, acknowledged=40, accepted_id=6))
    made.feed(ev.WriterGranted)
    made.link(Open(running=None, outcomes=(made.outcome(),)))
    assert [note.outcome.outcome for note in made.of(do.NotifyPublished)] == ["NO_RESULT"]
    made.write()
    made.write("enable")
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert (made.state.last_refusal, made.state.inspection) == (Refusal.NOT_READY, Inspection.NONE)
    made.feed(ev.OutcomeReceived, made.outcome())
    assert (made.state.queue, made.of(do.RequestOutcome), made.of(do.ForwardOutcome)) == ((), [], [])


def test_what_is_called_off_before_it_hinders_no_adoption_of_the_plcs_own(bench):
    made = bench(Journal(asked_id=7, highest=40))
    disowned, accepted = made.outcome(), made.outcome(sequence=42, trigger_id=8)
    made.link(Open(running=(43, 9), outcomes=(accepted, disowned)))
    assert made.state.journal.hidden == ()
    assert [outcome.sequence for outcome in made.state.queue] == [42]
    assert made.state.running.sequence == 43


def test_what_was_called_off_is_called_off_once(bench):
    """An older result waits for the PLC, so that it cannot be acknowledged in the PLC's stead."""
    older = bench().outcome()
    made = bench(Journal(queue=(older,), highest=41, acknowledged=40, disowned=(8,), accepted_id=7))
    called_off = made.outcome(sequence=42, trigger_id=8)
    made.link(Open(running=None, outcomes=(older, called_off)))
    made.feed(ev.OutcomeNoted, 42)
    made.actions.clear()
    for _ in range(3):
        made.feed(ev.RequestFailed, "a note was lost")
        made.link(Open(running=None, outcomes=(older, called_off)))
    assert made.state.journal.hidden == (42,)
    assert [note.outcome.sequence for note in made.of(do.NotifyPublished)] == [41, 41, 41]
    assert made.of(do.SaveJournal) == []


def test_a_request_that_fails_with_each_beat_is_logged_once(bench):
    made = bench()
    made.armed()
    made.actions.clear()
    for what in ("the records are damaged", "the records are damaged", "no answer", "no answer"):
        made.feed(ev.RequestFailed, what)
        made.beat()
    assert [each.text.rpartition(": ")[2] for each in made.of(do.Log)] == ["the records are damaged", "no answer"]
    made.feed(ev.OpenAnswered, made.state.open_request, Open(running=None, outcomes=()))
    made.feed(ev.RequestFailed, "no answer")
    assert "no answer" in made.of(do.Log)[-1].text


def test_a_question_for_what_is_open_that_failed_is_put_again_at_the_next_beat(bench):
    made = bench()
    made.beat()
    number = made.state.open_request
    made.feed(ev.RequestFailed, "it gave no answer")
    made.link()
    assert [request.number for request in made.of(do.RequestOpen)] == [number, number + 1]
    assert made.state.link is Link.UP


def test_a_hidden_sequence_however_high_is_acknowledged_where_nothing_waits(bench):
    hidden = 2**31
    made = bench(Journal(highest=hidden, acknowledged=hidden - 1, hidden=(hidden,)))
    made.link()
    assert (made.state.journal.acknowledged, made.state.journal.hidden) == (hidden, ())
