"""The table by itself: corners that are hard to reach from outside, and what is made from it."""

import zlib
from dataclasses import replace

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.document import DOCUMENT, document
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Arming, Inspection, Link, Result, Signal, Trigger
from plc_interface.handshake.state import Fault, restarted
from plc_interface.handshake.table import REGIONS
from plc_interface.handshake.view import line, lot_checksum, result_values, view
from plc_interface.registers.map import BY_NAME
from station.channel.line import BeginReply, LineFault, Open, PackmlState, Reason, Refusal
from station.messages.message import verbatim


def test_every_signal_and_every_mode_has_its_row():
    rows = [row for rows in REGIONS.values() for row in rows]
    assert {row.signal for row in rows} == set(Signal)
    for region, of_region in REGIONS.items():
        assert {row.mode for row in of_region} == set(region)
        reached = {of_region[0].mode}
        while more := {row.next for row in of_region if row.mode in reached} - reached:
            reached |= more
        assert reached == set(region)


def test_a_row_behind_one_without_a_condition_would_never_be_taken():
    for rows in REGIONS.values():
        closed = set()
        for row in rows:
            assert (row.mode, row.signal) not in closed
            if row.guard is None:
                closed.add((row.mode, row.signal))


def test_every_guard_and_effect_says_in_the_document_what_it_is():
    for rows in REGIONS.values():
        for row in rows:
            assert all(part.__doc__ for part in (*row.effects, *([row.guard] if row.guard else [])))


def test_the_document_shows_the_table_as_it_is():
    text = DOCUMENT.read_text(encoding="utf-8")
    assert document() == text, "run python -m plc_interface.handshake.document"


def test_a_pair_that_is_not_listed_changes_nothing_and_is_counted(bench):
    made = bench()
    made.armed()
    made.state.timers = {Signal.RESULT_DEADLINE: made.now_s}
    before = made.state.inspection
    made.feed(ev.Tick)
    assert (made.state.unlisted, made.state.inspection) == (1, before)
    assert "not foreseen" in made.of(do.Log)[-1].text


@pytest.mark.parametrize(
    ("name", "reasons", "changes"),
    [
        ("PASS", (), {"trigger_id": 8}),
        ("PASS", (Reason.SATURATED,), {}),
        ("PASS", (), {"late": True}),
        ("FAIL", (), {}),
    ],
)
def test_an_outcome_that_contradicts_itself_is_no_outcome(bench, name, reasons, changes):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome(name, *reasons, **changes))
    (shown,) = made.state.queue
    assert (shown.sequence, shown.trigger_id, shown.outcome) == (41, 7, "NO_RESULT")
    assert shown.reasons == (Reason.INTERNAL_FAULT,)
    assert shown.area_mm2 is None
    assert made.state.journal.verdicts == (shown,)


def test_a_sequence_given_twice_is_refused(bench):
    made = bench(Journal(highest=41))
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=1.0))
    assert (made.state.inspection, made.state.last_refusal) == (Inspection.NONE, Refusal.NOT_READY)
    assert made.state.trigger is Trigger.ANSWERED


def test_an_inspection_that_the_station_does_not_know_any_more_is_no_result(bench):
    made = bench()
    made.run()
    made.beat(boot="2")
    made.feed(ev.OpenAnswered, made.state.open_request, Open(running=None, outcomes=()))
    assert made.state.queue[0].reasons == (Reason.STATION_LOST,)
    assert made.state.link is Link.UP


def test_an_outcome_that_comes_late_is_answered_with_what_stands(bench):
    made = bench()
    made.run()
    for passed_s in (0.9, 0.9, 0.5):
        made.now_s += passed_s
        made.beat()
    (late,) = made.state.queue
    assert (late.outcome, late.reasons, late.late) == ("NO_RESULT", (Reason.LATE,), True)
    assert late.duration_ms == 2300
    actions = made.feed(ev.OutcomeReceived, made.outcome())
    assert [action.outcome for action in actions if isinstance(action, do.NotifyPublished)] == [late]
    assert made.state.queue == (late,)
    made.feed(ev.OutcomeNoted, 41)
    assert made.state.journal.verdicts == ()


def test_what_the_interface_says_by_itself_is_on_the_disk_before_anything_else(bench):
    made = bench()
    made.run()
    made.now_s += 10.0
    first, *rest = made.feed(ev.Tick)
    assert isinstance(first, do.SaveJournal)
    assert first.durable
    assert first.journal.verdicts == made.state.queue
    assert not any(isinstance(action, do.SaveJournal) for action in rest)


def test_an_unanswered_begin_is_refused_and_what_it_began_is_never_shown(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    actions = made.feed(ev.BeginFailed, made.state.pending.number)
    assert isinstance(actions[0], do.SaveJournal)
    assert actions[0].durable
    assert (made.state.last_refusal, made.state.link) == (Refusal.STATION_LOST, Link.RESUMING)
    made.feed(ev.BeginAnswered, 1, BeginReply(sequence=41, deadline_s=1.0))
    assert made.state.running is None
    actions = made.link(Open(running=(41, 7), outcomes=()))
    published, acknowledged = [action for action in actions if not isinstance(action, do.SaveJournal | do.Log)]
    assert (published.outcome.sequence, published.outcome.outcome, acknowledged) == (
        41,
        "NO_RESULT",
        do.NotifyAcknowledged(41),
    )
    assert view(made.state)["result_sequence"] == 0
    assert made.state.journal.acknowledged == 41


def test_what_the_station_begins_after_its_trigger_was_refused_is_aborted(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginFailed, made.state.pending.number)
    made.link(packml_state=PackmlState.IDLE)
    assert "acquiring" not in status(made), "it has not started when it reports its state and what is open"
    made.actions.clear()
    made.beat(packml_state=PackmlState.EXECUTE)
    assert "acquiring" in status(made)
    made.beat(packml_state=PackmlState.EXECUTE)
    [request] = made.of(do.RequestOpen)
    made.feed(ev.OpenAnswered, request.number, Open(running=(41, 7), outcomes=()))
    assert [action.outcome.sequence for action in made.of(do.NotifyPublished)] == [41]
    assert (made.state.link, made.state.queue, made.state.journal.acknowledged) == (Link.UP, (), 41)
    made.beat(packml_state=PackmlState.EXECUTE)
    assert len(made.of(do.RequestOpen)) == 1, "its fingers are still opening"


@pytest.mark.parametrize("reports", [PackmlState.STARTING, PackmlState.EXECUTE])
def test_an_accepted_fruit_asks_for_nothing_after_a_trigger_that_was_lost(bench, reports):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginFailed, made.state.pending.number)
    made.link(packml_state=PackmlState.IDLE)
    made.write("enable")
    made.write("enable", "trigger", trigger_id=8)
    made.actions.clear()
    made.beat(packml_state=reports)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=42, deadline_s=2.0))
    made.beat(packml_state=reports)
    made.feed(ev.OutcomeReceived, made.outcome(sequence=42, trigger_id=8))
    made.beat(packml_state=reports)
    assert made.of(do.RequestOpen) == []


def test_a_station_busy_with_an_unknown_inspection_is_asked_which_and_stays_online(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(refusal=Refusal.BUSY))
    assert (made.state.last_refusal, made.state.link) == (Refusal.BUSY, Link.UP)
    made.feed(ev.OpenAnswered, made.state.open_request, Open(running=(41, 6), outcomes=()))
    assert [action.outcome.sequence for action in made.of(do.NotifyPublished)] == [41]
    assert (made.state.queue, made.state.journal.acknowledged) == ((), 41)


def test_the_answer_to_another_begin_accepts_nothing(bench):
    made = bench()
    made.armed("buffer_results")
    made.write("enable", "trigger", trigger_id=7)
    first = made.state.pending.number
    made.feed(ev.BeginFailed, first)
    made.link()
    made.write("enable")
    made.write("enable", "trigger", trigger_id=8)
    made.feed(ev.BeginAnswered, first, BeginReply(sequence=41, deadline_s=1.0))
    assert (made.state.running, made.state.pending.trigger_id) == (None, 8)


def test_what_was_open_before_an_acceptance_does_not_end_it(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.RequestFailed, "a note was lost")
    made.beat()
    request_before = made.state.open_request
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=1.0))
    made.feed(ev.OpenAnswered, request_before, Open(running=None, outcomes=()))
    assert (made.state.inspection, made.state.link) == (Inspection.RUNNING, Link.RESUMING)
    made.link(Open(running=(41, 7), outcomes=()))
    assert (made.state.inspection, made.state.link) == (Inspection.RUNNING, Link.UP)


def test_what_is_hidden_is_acknowledged_only_behind_what_still_waits(bench):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    made.write("enable", "buffer_results")
    made.write("enable", "buffer_results", "trigger", trigger_id=8)
    made.feed(ev.BeginFailed, made.state.pending.number)
    made.link(Open(running=(42, 8), outcomes=made.state.queue))
    assert (made.state.journal.hidden, made.of(do.NotifyAcknowledged)) == ((42,), [])
    made.write("enable", acknowledged_sequence=41)
    assert [action.sequence for action in made.of(do.NotifyAcknowledged)] == [41, 42]
    assert made.state.journal.hidden == ()


def test_a_trigger_that_a_restart_interrupts_is_refused_and_what_it_began_is_never_shown(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    again = bench(made.of(do.SaveJournal)[-1].journal)
    assert (again.state.last_refusal, again.state.last_refused_id) == (Refusal.STATION_LOST, 7)
    again.link(Open(running=(41, 7), outcomes=()))
    assert (again.state.queue, again.state.running, again.state.journal.acknowledged) == ((), None, 41)


@pytest.mark.parametrize("linked_first", [True, False])
@pytest.mark.parametrize("journal_of", ["queue", "running"])
def test_an_acknowledgement_that_a_full_disk_kept_from_the_journal_is_in_the_first_write(
    bench, journal_of, linked_first
):
    made = bench()
    made.run()
    running = made.state.journal
    made.feed(ev.OutcomeReceived, made.outcome())
    journal = made.state.journal if journal_of == "queue" else running
    made.write("enable", "acknowledge", acknowledged_sequence=41)
    again = bench(journal)
    again.feed(ev.WriterGranted)
    seen = [view(again.state)]
    for links in (linked_first, not linked_first):
        if links:
            again.link(Open(running=None, outcomes=(made.outcome(),)))
        else:
            again.write("enable", acknowledged_sequence=41)
        seen.append(view(again.state))
    assert [each["result_sequence"] for each in seen] == [0, 0, 0]
    assert (again.state.journal.acknowledged, again.state.queue, again.state.faults) == (41, (), ())
    assert again.of(do.NotifyPublished)[0].outcome == made.outcome()
    assert again.of(do.NotifyAcknowledged)[-1].sequence == 41


def test_after_a_start_a_result_that_was_not_taken_is_published_with_the_first_write(bench):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    again = bench(made.state.journal)
    again.feed(ev.WriterGranted)
    again.feed(ev.PlcWrote, again.inputs, frozenset({"plc_heartbeat"}))
    assert view(again.state)["result_sequence"] == 0
    again.write("enable", acknowledged_sequence=40)
    assert view(again.state)["result_sequence"] == 41


def test_what_stands_is_told_once_the_station_is_back_and_no_timer_is_left(bench):
    made = bench()
    made.run()
    made.now_s += 1.5
    made.feed(ev.Tick)
    assert Signal.RESULT_DEADLINE not in made.state.timers
    actions = made.link(Open(running=(41, 7), outcomes=()))
    assert [action.outcome for action in actions if isinstance(action, do.NotifyPublished)] == list(made.state.queue)


def test_with_its_journal_lost_the_interface_takes_over_what_the_station_holds(bench):
    made = bench()
    made.feed(ev.WriterGranted)
    ended = made.outcome("FAIL", Reason.AREA_OVER_LIMIT, sequence=40, trigger_id=6)
    made.link(Open(running=(41, 7), outcomes=(ended,)))
    made.write()
    seen = view(made.state)
    assert (seen["result_sequence"], seen["result_trigger_id"], seen["accepted_trigger_id"]) == (40, 6, 7)
    assert [action.sequence for action in made.of(do.RequestOutcome)] == [41]
    made.feed(ev.OutcomeReceived, made.outcome())
    assert [outcome.sequence for outcome in made.state.queue] == [40, 41]


def test_a_doubled_command_of_the_run_before_is_not_carried_out_again(bench):
    executing = BY_NAME["command_result"].code("executing")
    made = bench(Journal(command_sequence=5, command_result=executing))
    made.armed()
    made.write("enable", "execute_command", command_code=3, command_sequence=5)
    assert made.of(do.RequestCommand) == []
    assert view(made.state)["command_result"] == BY_NAME["command_result"].code("timed_out")


@pytest.mark.parametrize("result", ["done", "failed"])
@pytest.mark.parametrize("other", [{"command_code": 3}, {"command_argument": 2}])
def test_another_command_under_the_last_ones_number_fails_and_is_named(bench, result, other):
    """A PLC that starts to count at 1 after its restart must not read `done` for what was not carried out."""
    made = bench()
    made.armed()
    first = {"command_code": 1, "command_argument": 3, "command_sequence": 1}
    made.write("enable", "execute_command", **first)
    made.feed(ev.CommandAnswered, made.state.command_request, done=result == "done", why="")
    made.write("enable")
    again = bench(Journal.model_validate_json(made.state.journal.model_dump_json(exclude_defaults=True)))
    again.armed()
    again.write("enable", "execute_command", **first)
    assert (view(again.state)["command_result"], again.state.faults) == (BY_NAME["command_result"].code(result), ())
    for faults in ((Fault.COMMAND_REUSED,), ()):
        again.write("enable", "clear_error")
        again.write("enable", "execute_command", **{**first, **other})
        assert view(again.state)["command_result"] == BY_NAME["command_result"].code("failed")
        assert "command_failed" in status(again)
        assert again.state.faults == faults, "the same again has the same result and is no new fault"
    assert again.of(do.RequestCommand) == []
    again.write("enable")
    again.write("enable", "execute_command", **{**first, **other, "command_sequence": 2})
    assert len(again.of(do.RequestCommand)) == 1


@pytest.mark.parametrize("trigger_id", [1, 7])
def test_a_trigger_bit_left_high_over_a_reconnect_is_the_same_trigger(bench, trigger_id):
    made = bench()
    made.run(trigger_id)
    made.feed(ev.WriterWithdrawn)
    made.feed(ev.WriterGranted)
    assert made.state.arming is Arming.WITHDRAWN
    made.write("enable", "trigger")
    assert made.state.trigger is Trigger.ANSWERED
    assert (made.state.last_refusal, made.state.counters["count_triggers"]) == (None, 1)


def test_a_plc_that_writes_the_sequence_first_and_its_bit_then_sees_result_valid_fall(bench):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    made.write("enable")
    made.feed(ev.PlcWrote, made.inputs, frozenset())
    assert made.state.result is Result.PUBLISHED
    made.write("enable", acknowledged_sequence=41)
    assert made.state.result is Result.EMPTY
    made.write("enable", "acknowledge")
    assert made.state.result is Result.TAKEN
    made.write("enable")
    assert made.state.result is Result.EMPTY


def test_the_very_first_sequence_is_acknowledged_by_its_number(bench):
    made = bench()
    made.run(sequence=1)
    made.feed(ev.OutcomeReceived, made.outcome(sequence=1))
    made.write("enable", acknowledged_sequence=1)
    assert made.state.result is Result.EMPTY
    assert len(made.of(do.NotifyAcknowledged)) == 1


def test_the_very_first_outcome_may_come_before_the_plc_has_written(bench):
    made = bench()
    made.link(Open(running=None, outcomes=(made.outcome(sequence=1),)))
    assert [outcome.sequence for outcome in made.state.queue] == [1]


def test_starts_and_resets_of_the_counters_wrap_round(bench):
    journal = bench(Journal(boots=2**16 - 1, epoch=2**32 - 1)).state.journal
    assert (journal.boots, journal.epoch) == (0, 0)
    journal = bench(Journal(boots=2**16 - 2, epoch=2**32 - 2)).state.journal
    assert (journal.boots, journal.epoch) == (2**16 - 1, 2**32 - 1)
    made = bench(Journal(epoch=2**32 - 3))
    made.armed()
    for epoch in (2**32 - 1, 0):
        made.write("enable", "reset_counters")
        assert made.state.journal.epoch == epoch
        made.write("enable")


def test_the_bit_alone_or_a_sequence_not_shown_acknowledges_nothing(bench):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    made.write("enable", "acknowledge")
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)
    made.write("enable", acknowledged_sequence=41 << 16)
    assert made.state.counters["count_communication"] == 2
    assert (made.state.result, made.of(do.NotifyAcknowledged)) == (Result.PUBLISHED, [])
    made.write("enable", "clear_error")
    assert made.state.faults == ()
    assert len(made.of(do.ClearFaults)) == 1


@pytest.mark.parametrize("lost", ["writer", "heartbeat", "interface"])
def test_an_enable_left_high_over_a_loss_never_arms_again(bench, lost):
    made = bench()
    made.armed()
    if lost == "writer":
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
    elif lost == "heartbeat":
        for count in (1, 2):
            made.write("enable", plc_heartbeat=count)
        made.now_s += made.settings.plc_heartbeat_timeout_s
        made.feed(ev.Tick)
    else:
        made = bench(made.state.journal)
        made.feed(ev.WriterGranted)
        made.write("enable")
    made.link(boot="2")
    for trigger_id in (7, 8):
        made.write("enable")
        made.write("enable", "trigger", trigger_id=trigger_id)
        assert (made.state.last_refusal, made.state.last_refused_id) == (Refusal.NOT_ENABLED, trigger_id)
    assert made.of(do.RequestBegin) == []
    inhibited = BY_NAME["more_status"].flags(["enable_inhibited"])
    seen = [view(made.state)["more_status"]]
    for bits in ((), ("enable",)):
        made.write(*bits)
        seen.append(view(made.state)["more_status"])
    assert seen == [inhibited, 0, 0]
    assert made.state.arming is Arming.ARMED


def test_a_lost_station_gives_one_outcome_and_what_it_says_later_does_not_replace_it(bench):
    made = bench()
    made.run()
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    (lost,) = made.state.queue
    assert (lost.sequence, lost.outcome, lost.reasons) == (41, "NO_RESULT", (Reason.STATION_LOST,))
    assert made.of(do.ForwardOutcome) == [do.ForwardOutcome(lost)]
    made.feed(ev.OutcomeReceived, made.outcome())
    made.link(Open(running=None, outcomes=(made.outcome(),)), boot="2")
    made.feed(ev.OutcomeReceived, made.outcome())
    assert made.state.queue == (lost,)
    assert view(made.state)["result_outcome"] == BY_NAME["result_outcome"].code("NO_RESULT")
    assert made.of(do.ForwardOutcome) == [do.ForwardOutcome(lost)]
    assert {action.outcome for action in made.of(do.NotifyPublished)} == {lost}
    made.write("enable", acknowledged_sequence=41)
    made.feed(ev.OutcomeReceived, made.outcome())
    assert made.state.queue == ()


def test_what_the_plc_acknowledged_while_the_station_was_lost_is_told_also_while_it_still_runs(bench):
    made = bench()
    made.run()
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    made.write("enable", acknowledged_sequence=41)
    made.actions.clear()
    made.link(Open(running=(41, 7), outcomes=()))
    notes = [action for action in made.actions if isinstance(action, do.NotifyPublished | do.NotifyAcknowledged)]
    assert [type(action) for action in notes] == [do.NotifyPublished, do.NotifyAcknowledged]
    assert notes[-1] == do.NotifyAcknowledged(41)


def test_an_outcome_acknowledged_before_the_station_noted_it_is_told_again_after_its_restart(bench):
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    (shown,) = made.state.queue
    made.write("enable", acknowledged_sequence=41)
    made.feed(ev.RequestFailed, "the note was lost")
    made.actions.clear()
    made.link(Open(running=None, outcomes=(made.outcome("NO_RESULT", Reason.STATION_LOST),)))
    published = [action.outcome for action in made.actions if isinstance(action, do.NotifyPublished)]
    assert published == [shown]
    made.feed(ev.OutcomeNoted, 41)
    assert made.state.journal.verdicts == ()


def status(made):
    word = view(made.state)["status"]
    assert isinstance(word, int)
    return BY_NAME["status"].names(word)


def test_a_trigger_is_accepted_only_while_its_fruit_could_be_diverted(bench):
    made = bench()
    made.armed()
    made.feed(ev.OutputChanged, False)
    made.write("enable", "trigger", trigger_id=7)
    assert made.of(do.RequestBegin) == []
    assert made.state.last_refusal is Refusal.NOT_READY
    assert "trigger_ready" not in status(made)
    made.feed(ev.OutputChanged, True)
    assert "trigger_ready" in status(made)
    made.write("enable")
    made.write("enable", "trigger", trigger_id=7)
    assert len(made.of(do.RequestBegin)) == 1


def test_timers_that_ran_out_together_go_in_a_fixed_order(bench):
    made = bench()
    made.run()
    made.now_s += 60.0
    made.feed(ev.Tick)
    assert made.state.queue[0].reasons == (Reason.STATION_LOST,)
    assert made.state.link is Link.LOST
    assert made.state.trigger is Trigger.STUCK
    assert made.state.timers == {}


def test_values_beyond_their_registers_are_shown_at_the_bound(bench):
    outcome = bench().outcome(area_mm2=1e12, closing_mm=-1e6, area_px=2**40)
    shown = result_values(outcome)
    assert shown["result_area_mm2_x100"] == 2**31 - 1
    assert shown["result_closing_mm_x100"] == -(2**15) + 1
    assert shown["result_area_px"] == 2**32 - 2


def test_an_area_of_nothing_is_shown_as_none_at_all(bench):
    assert result_values(bench().outcome(area_mm2=0.0))["result_area_mm2_x100"] == 0


def test_a_lots_checksum_is_that_of_what_the_registers_show_of_it():
    assert lot_checksum("GRÜN 7") == zlib.crc32(b"GR?N 7")
    assert lot_checksum("") == 0


@pytest.mark.parametrize(("counted", "after"), [(63, 64), (2**32 - 1, 0)])
def test_counters_wrap_round_at_32_bits(bench, counted, after):
    made = bench()
    made.state.counters = {**made.state.counters, "count_missed": counted}
    made.armed()
    made.write("enable", "trigger", trigger_id=0)
    assert made.state.counters["count_missed"] == after


GATE_LOST = LineFault(part="can", what=verbatim("the gate is lost"))


def test_the_station_is_told_of_the_line(bench):
    made = bench()
    made.armed()
    state = line(made.state, {"count_bad_requests": 3}, (GATE_LOST,))
    assert (state.plc_connected, state.plc_alive, state.enabled, state.waiting) == (True, False, True, 0)
    assert state.counters["count_bad_requests"] == 3
    assert state.faults == (GATE_LOST,)


@pytest.mark.parametrize(("lost", "withdrawn"), [("heartbeat", True), ("writer", True), ("released", False)])
def test_the_station_misses_a_plc_that_goes_while_it_is_armed_and_no_other(bench, lost, withdrawn):
    made = bench()
    made.feed(ev.WriterGranted)
    assert not line(made.state, {}, ()).enable_withdrawn, "one that was never armed is not missed"
    made.armed()
    for count in (1, 2):
        made.write("enable", plc_heartbeat=count)
    if lost == "released":
        made.write()
    if lost != "heartbeat":
        made.feed(ev.WriterWithdrawn)
    made.now_s += made.settings.plc_heartbeat_timeout_s
    made.feed(ev.Tick)
    state = line(made.state, {}, ())
    assert (state.plc_alive, state.enabled, state.enable_withdrawn) == (False, False, withdrawn)
    made.feed(ev.WriterGranted)
    made.write(plc_heartbeat=7)
    made.write("enable", plc_heartbeat=8)
    state = line(made.state, {}, ())
    assert (state.plc_alive, state.enabled, state.enable_withdrawn) == (True, True, False)


def test_a_plc_back_with_its_bit_high_after_the_answer_came_has_to_take_it_back(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.WriterWithdrawn)
    assert made.state.pending is not None
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert made.state.trigger is Trigger.HELD
    made.feed(ev.WriterGranted)
    made.write("trigger", trigger_id=7)
    assert (made.state.trigger, made.state.unlisted) == (Trigger.ANSWERED, 0)
    made.now_s += made.settings.handshake_timeout_s
    made.feed(ev.Tick)
    assert made.state.trigger is Trigger.STUCK
    assert Fault.TRIGGER_NOT_RESET in made.state.faults


def test_a_command_while_another_is_executed_is_a_fault_and_begins_nothing(bench):
    made = bench()
    made.armed()
    made.write("enable", "execute_command", command_code=1, command_sequence=5)
    made.write("enable")
    made.write("enable", "execute_command", command_code=1, command_sequence=6)
    assert made.state.faults == (Fault.COMMAND_BUSY,)
    assert len(made.of(do.RequestCommand)) == 1


def test_an_inspection_that_ran_before_a_restart_began_as_long_ago_as_it_did(bench):
    made = bench()
    made.run()
    again = restarted(made.state.journal, ev.Moment(5.0, made.at().utc_ms + 3000), 2.0)
    assert again.running is not None
    assert again.running.began_s == pytest.approx(2.0)


@pytest.mark.parametrize("new_writer", [True, False])
def test_an_interface_that_ends_begins_nothing_whatever_the_plc_writes(bench, new_writer):
    made = bench()
    made.armed()
    made.feed(ev.ShuttingDown)
    if new_writer:
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
    for bits in (("enable", "trigger"), ("offline",), (), ("enable",), ("enable", "trigger")):
        made.write(*bits, trigger_id=7)
        assert not {"online", "trigger_ready"} & status(made)
    assert made.of(do.RequestBegin) == []
    assert made.state.last_refusal is Refusal.OFFLINE
    made.feed(ev.ShuttingDown)
    assert made.state.unlisted == 0


@pytest.mark.parametrize("with_control", [True, False])
def test_a_writer_that_never_changes_its_heartbeat_is_not_monitored_whatever_the_one_before_left(bench, with_control):
    made = bench()
    made.armed()
    for count in (344, 345):
        made.write("enable", plc_heartbeat=count)
    assert made.state.watched
    made.feed(ev.WriterWithdrawn)
    made.feed(ev.WriterGranted)
    heartbeat = {"plc_heartbeat": 0}
    for bits in ((), ("enable",), ("enable",)):
        made.write(*bits, **(heartbeat if with_control else {}))
        if not with_control:
            made.inputs = replace(made.inputs, **heartbeat)
            made.feed(ev.PlcWrote, made.inputs, frozenset(heartbeat))
    assert not made.state.watched
    made.now_s += made.settings.plc_heartbeat_timeout_s
    made.feed(ev.Tick)
    assert made.state.arming is Arming.ARMED
    made.write("enable", plc_heartbeat=1)
    assert made.state.watched
