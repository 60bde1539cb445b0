"""A start from the journal, and what the station says it holds open, settled."""

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Inspection
from station.channel.line import BeginReply, Open, Reason, Refusal


def test_a_trigger_that_was_pending_at_the_end_counts_as_one_that_was_missed(bench):
    made = bench(Journal(asked_id=7))
    counters = made.state.counters
    assert (counters["count_triggers"], counters["count_missed"]) == (1, 1)
    assert sum(counters.values()) == 2
    assert (made.state.missed, made.state.last_refusal, made.state.last_refused_id) == (True, Refusal.STATION_LOST, 7)
    assert not any(bench().state.counters.values())


def test_starts_of_the_station_are_counted_modulo_65536(bench):
    made = bench()
    made.feed(ev.WriterGranted)
    made.link()
    made.state.station_boots = 65535
    made.feed(ev.Beat, made.station_state(boot="2"))
    assert made.state.station_boots == 0


def test_an_inspection_that_may_be_the_pending_triggers_is_its_own_once_the_station_has_answered(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=6)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(refusal=Refusal.BUSY))
    asked = made.state.open_request
    made.write("enable")
    made.write("enable", "trigger", trigger_id=7)
    pending = made.state.pending.number
    made.feed(ev.OpenAnswered, asked, Open(running=(42, 7), outcomes=()))
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
