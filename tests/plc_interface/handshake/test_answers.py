"""Answers of the station, and those that do not come: what is counted and stored of them."""

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.modes import Command, Inspection, Link
from plc_interface.handshake.outcomes import MOST_UNNOTED
from plc_interface.registers.map import BY_NAME
from station.channel.line import BeginReply, CommandName, Refusal
from station.messages.message import verbatim


def with_pending_trigger(bench, journal=None, trigger_id=7):
    """Return a bench whose trigger the station has not answered."""
    made = bench(journal)
    made.armed()
    made.write("enable", "trigger", trigger_id=trigger_id)
    assert made.state.pending is not None
    return made


@pytest.mark.parametrize(("refusal", "synchronised"), [(Refusal.BUSY, False), (Refusal.NOT_READY, True)])
def test_a_station_that_is_busy_unasked_is_asked_what_it_has_open(bench, refusal, synchronised):
    made = with_pending_trigger(bench)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(refusal=refusal))
    assert made.state.last_refusal is refusal
    assert (made.state.open_request is None) is synchronised


@pytest.mark.parametrize("reply", [BeginReply(sequence=41, refusal=Refusal.BUSY), BeginReply()])
def test_an_answer_that_says_both_or_nothing_accepts_no_trigger(bench, reply):
    made = with_pending_trigger(bench)
    made.feed(ev.BeginAnswered, made.state.pending.number, reply)
    assert made.state.inspection is Inspection.NONE
    assert made.state.last_refusal is (reply.refusal or Refusal.NOT_READY)
    assert not any("gave a sequence again" in str(each.text) for each in made.of(do.Log))


def test_the_last_eight_triggers_whose_acceptance_is_unknown_are_remembered(bench):
    made = with_pending_trigger(bench, Journal(disowned=tuple(range(101, 109))))
    made.feed(ev.BeginFailed, made.state.pending.number)
    assert made.state.journal.disowned == (*range(102, 109), 7)


def test_a_number_that_the_plc_wrote_before_its_inspection_began_is_forgotten_with_it(bench):
    made = bench()
    made.feed(ev.WriterGranted)
    made.write(acknowledged_sequence=41)
    assert made.state.taken == 41
    made.link()
    made.write("enable")
    made.write("enable", "trigger", trigger_id=7)
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=41, deadline_s=2.0))
    assert made.state.taken == 0


def test_an_outcome_that_the_station_does_not_give_is_asked_for_again_if_it_is_the_running_ones(bench):
    made = bench()
    made.run()
    before = len(made.of(do.Log))
    made.feed(ev.OutcomeFailed, 40, "no answer")
    assert (made.state.link, len(made.of(do.Log))) == (Link.UP, before)
    made.feed(ev.OutcomeFailed, 41, "no answer")
    assert made.state.link is Link.RESUMING
    assert "inspection 41" in str(made.of(do.Log)[-1].text)


def test_so_many_outcomes_are_kept_for_a_station_that_notes_none(bench):
    made = bench()
    made.run()
    outcome = made.outcome()
    verdicts = tuple(outcome.model_copy(update={"sequence": number}) for number in range(1, MOST_UNNOTED + 1))
    made = bench(Journal(verdicts=verdicts, highest=MOST_UNNOTED))
    assert MOST_UNNOTED == 64
    made.run(sequence=100)
    made.feed(ev.OutcomeReceived, outcome.model_copy(update={"sequence": 100}))
    assert [each.sequence for each in made.state.journal.verdicts] == [*range(2, MOST_UNNOTED + 1), 100]


def test_a_duration_that_a_wrong_clock_makes_is_as_long_as_its_registers_hold(bench):
    made = bench()
    made.run()
    made.state.running = made.state.running.model_copy(update={"began_s": made.now_s - 1e7})
    made.now_s += made.settings.station_lost_after_s
    made.feed(ev.Tick)
    assert made.state.queue[0].duration_ms == 2**32 - 1


@pytest.mark.parametrize(("before", "after"), [(31, 32), (65_535, 0)])
def test_starts_and_heartbeats_wrap_round_at_16_bits(bench, before, after):
    made = bench()
    made.link()
    made.state.station_boots = made.state.heartbeat = before
    made.beat()
    assert made.state.heartbeat == after
    made.link(boot="2")
    assert made.state.station_boots == after


def ordered(bench, code, sequence=5):
    made = bench()
    made.armed()
    made.write("enable", "execute_command", command_code=code, command_sequence=sequence)
    (request,) = made.of(do.RequestCommand)
    return made, request


def test_a_command_given_again_is_not_carried_out_again_and_is_done_if_it_was(bench):
    made, request = ordered(bench, 1)
    for done in (True, False):
        made.feed(ev.CommandAnswered, request.number, done, None if done else verbatim("not now"))
        assert made.state.command is (Command.DONE if done else Command.FAILED)
        made.write("enable")
        assert made.state.command is Command.IDLE
        made.write("enable", "execute_command")
        assert made.state.command is (Command.DONE if done else Command.FAILED)
        made.write("enable")
        if done:
            made.write("enable", "execute_command", command_sequence=6)
            request = made.of(do.RequestCommand)[-1]
    assert len(made.of(do.RequestCommand)) == 2


def code_of(command):
    return BY_NAME["command_code"].code(command.value)


def test_a_trigger_during_a_change_of_recipe_alone_is_refused_for_it(bench):
    for command in (CommandName.CHANGE_RECIPE, CommandName.RESET):
        made, request = ordered(bench, code_of(command))
        assert request.command is command
        made.write("enable", "execute_command", "trigger", trigger_id=7)
        changing = command is CommandName.CHANGE_RECIPE
        assert made.state.last_refusal is (Refusal.RECIPE_CHANGING if changing else None)
