"""Acknowledgements: by number, by bit, in either order, and wrong ones."""

import pytest

from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Result
from plc_interface.handshake.state import Fault
from station.channel.line import BeginReply, Open


def shown(bench):
    """Return a bench that shows the result 41."""
    made = bench()
    made.run()
    made.feed(ev.OutcomeReceived, made.outcome())
    assert made.state.published == 41
    made.write("enable")
    return made


@pytest.mark.parametrize("bits", [("enable",), ("enable", "acknowledge")])
def test_a_sequence_that_was_never_shown_is_a_wrong_acknowledgement(bench, bits):
    made = bench()
    made.armed()
    made.write(*bits, acknowledged_sequence=1)
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)


@pytest.mark.parametrize("again", [41, 1])
def test_the_bit_may_follow_the_number_once(bench, again):
    made = shown(bench)
    made.write("enable", acknowledged_sequence=41)
    assert made.state.journal.acknowledged == 41
    made.write("enable", plc_heartbeat=1)
    made.write("enable", "acknowledge")
    assert (made.state.result, made.state.faults) == (Result.TAKEN, ())
    made.write("enable")
    made.write("enable", "acknowledge", acknowledged_sequence=again)
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)


@pytest.mark.parametrize("again", [41, 1])
def test_a_bit_with_the_number_confirms_it_once(bench, again):
    made = shown(bench)
    made.write("enable", "acknowledge", acknowledged_sequence=41)
    made.write("enable")
    made.write("enable", "acknowledge", acknowledged_sequence=again)
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)


@pytest.mark.parametrize(("sequence", "again"), [(41, 41), (41, 1), (1, 1)])
def test_a_bit_in_the_first_write_after_a_start_has_confirmed_its_number(bench, sequence, again):
    outcome = shown(bench).state.queue[0].model_copy(update={"sequence": sequence})
    made = bench(Journal(queue=(outcome,), highest=41))
    made.feed(ev.WriterGranted)
    made.write("enable", "acknowledge", acknowledged_sequence=sequence)
    assert (made.state.queue, made.state.result, made.state.faults) == ((), Result.EMPTY, ())
    made.write("enable")
    made.write("enable", "acknowledge", acknowledged_sequence=again)
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)


def test_a_bit_may_follow_the_number_of_the_first_write_after_a_start(bench):
    made = bench(Journal(queue=(shown(bench).state.queue[0],), highest=41))
    made.feed(ev.WriterGranted)
    made.write("enable", acknowledged_sequence=41)
    made.write("enable", "acknowledge")
    assert (made.state.queue, made.state.result, made.state.faults) == ((), Result.TAKEN, ())


def test_what_was_called_off_is_passed_over_by_the_first_write_after_a_start(bench):
    made = bench(Journal(queue=(shown(bench).state.queue[0],), highest=41, hidden=(42,)))
    made.link()
    made.feed(ev.WriterGranted)
    assert made.state.journal.hidden == (42,)
    made.write("enable", acknowledged_sequence=41)
    assert (made.state.journal.acknowledged, made.state.journal.hidden) == (42, ())


def called_off_behind(bench):
    """Return a bench whose PLC took 41; a trigger after it was refused as lost, and its inspection 42 is called off."""
    made = shown(bench)
    made.write("enable", "acknowledge", acknowledged_sequence=41)
    made.write("enable")
    made.write("enable", "trigger", trigger_id=8)
    made.feed(ev.BeginFailed, made.state.pending.number)
    made.write("enable")
    made.link(Open(running=(42, 8), outcomes=()))
    assert (made.state.journal.acknowledged, made.state.journal.plc_taken) == (42, 41)
    return made


def test_a_plc_that_writes_again_what_it_took_is_right_also_where_one_behind_it_was_called_off(bench):
    """As the function block does, whose registers are 0 while it does not see the station's heartbeat."""
    made = called_off_behind(bench)
    made.link(Open(running=None, outcomes=()), boot="2")
    made.write("enable", acknowledged_sequence=0)
    made.write("enable", acknowledged_sequence=41)
    assert made.state.faults == ()
    made.write("enable", acknowledged_sequence=40)
    assert made.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)


def test_so_is_one_that_does_so_after_a_start(bench):
    made = bench(Journal.model_validate_json(called_off_behind(bench).state.journal.model_dump_json()))
    made.feed(ev.WriterGranted)
    made.write("enable", acknowledged_sequence=0)
    made.write("enable", acknowledged_sequence=41)
    assert made.state.faults == ()


def test_a_bit_left_high_for_what_it_took_is_right_after_a_reconnect(bench):
    made = called_off_behind(bench)
    made.feed(ev.WriterWithdrawn)
    made.feed(ev.WriterGranted)
    made.write("enable", "acknowledge", acknowledged_sequence=41)
    assert made.state.faults == (Fault.WRITER_LOST,)


def test_what_the_plc_takes_next_is_the_last_it_took(bench):
    made = called_off_behind(bench)
    next_fruit(made, 43)
    made.write("enable", "acknowledge", acknowledged_sequence=43)
    assert (made.state.journal.acknowledged, made.state.journal.plc_taken) == (43, None)


def test_a_wrong_acknowledgement_of_what_was_taken_does_not_hide_an_early_one(bench):
    before = shown(bench)
    before.write("enable", "acknowledge", acknowledged_sequence=41)
    before.write("enable")
    before.write("enable", "trigger", trigger_id=8)
    before.feed(ev.BeginAnswered, before.state.pending.number, BeginReply(sequence=42, deadline_s=2.0))
    before.write("enable", acknowledged_sequence=42)
    before.write("enable", "acknowledge", acknowledged_sequence=41)
    outcome = before.outcome().model_copy(update={"sequence": 42, "trigger_id": 8})
    before.feed(ev.OutcomeReceived, outcome)
    made = bench(before.state.journal)
    made.feed(ev.WriterGranted)
    made.write("enable", acknowledged_sequence=42)
    assert (made.state.result, made.state.published) == (Result.PUBLISHED, 42)


@pytest.mark.parametrize("register", ["acknowledged_sequence", "control"])
def test_either_register_of_the_acknowledgement_is_a_first_write(bench, register):
    made = bench(Journal(queue=(shown(bench).state.queue[0],), highest=41))
    made.feed(ev.WriterGranted)
    made.feed(ev.PlcWrote, made.inputs, frozenset({"trigger_id"}))
    assert made.state.result is Result.WITHHELD
    made.feed(ev.PlcWrote, made.inputs, frozenset({register}))
    assert made.state.result is Result.PUBLISHED


@pytest.mark.parametrize("early", ["before it begins", "while it runs"])
@pytest.mark.parametrize("ended", [False, True], ids=["started again while it runs", "started again after its outcome"])
def test_an_outcome_is_shown_although_the_plc_acknowledged_its_number_early(bench, early, ended):
    before = bench()
    before.armed()
    if early == "before it begins":
        before.write("enable", acknowledged_sequence=41)
    before.write("enable", "trigger", trigger_id=7)
    before.feed(ev.BeginAnswered, before.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    if early == "while it runs":
        before.write("enable", "acknowledge", acknowledged_sequence=41)
    assert before.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)
    outcome = before.outcome()
    if ended:
        before.feed(ev.OutcomeReceived, outcome)
    made = bench(Journal.model_validate_json(before.state.journal.model_dump_json()))
    made.feed(ev.WriterGranted)
    made.write("enable", acknowledged_sequence=41)
    if not ended:
        made.link(Open(running=(41, 7), outcomes=()))
        made.feed(ev.OutcomeReceived, outcome)
    assert (made.state.result, made.state.published) == (Result.PUBLISHED, 41)
    made.write("enable", "acknowledge")
    assert made.state.journal.acknowledged == 41


def test_an_outcome_behind_the_one_that_is_shown_is_not_taken_by_its_number(bench):
    before = shown(bench)
    before.write("enable", "buffer_results")
    before.write("enable", "buffer_results", "trigger", trigger_id=8)
    before.feed(ev.BeginAnswered, before.state.pending.number, BeginReply(sequence=42, deadline_s=2.0))
    second = before.outcome().model_copy(update={"sequence": 42, "trigger_id": 8})
    before.feed(ev.OutcomeReceived, second)
    before.write("enable", "buffer_results", acknowledged_sequence=42)
    assert before.state.faults == (Fault.WRONG_ACKNOWLEDGEMENT,)
    made = bench(before.state.journal)
    made.feed(ev.WriterGranted)
    for sequence in (41, 42):
        made.write("enable", "buffer_results")
        assert made.state.published == sequence
        made.write("enable", "buffer_results", acknowledged_sequence=sequence)
    assert made.state.queue == ()


def next_fruit(made, sequence, *bits):
    """Another fruit, up to its shown result."""
    made.write("enable", *bits)
    made.write("enable", "trigger", *bits, trigger_id=sequence)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=sequence, deadline_s=2.0))
    made.feed(ev.OutcomeReceived, made.outcome().model_copy(update={"sequence": sequence, "trigger_id": sequence}))
    assert made.state.published == sequence


def test_a_bit_that_the_plc_forgets_counts_as_fallen_until_it_is(bench):
    made = shown(bench)
    made.write("enable", "acknowledge", acknowledged_sequence=41)
    assert made.state.result is Result.TAKEN
    made.now_s += made.settings.handshake_timeout_s
    made.feed(ev.Tick)
    assert (made.state.result, made.state.faults) == (Result.EMPTY, (Fault.ACKNOWLEDGE_NOT_RESET,))
    made.link()
    next_fruit(made, 42, "acknowledge")
    made.write("enable", "acknowledge", acknowledged_sequence=42)
    assert made.state.result is Result.EMPTY
    next_fruit(made, 43)
    made.write("enable", "acknowledge", acknowledged_sequence=43)
    assert made.state.result is Result.TAKEN
