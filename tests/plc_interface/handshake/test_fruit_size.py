"""The fruit's size on its way through the interface: given with a trigger, used up by it, echoed with its outcome."""

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.state import Size
from station.channel.line import BeginReply, Refusal

NONE = (0, 0)


def requested_sizes(made):
    """Sizes of the inspections that were requested of the station."""
    return [(request.fruit_length_mm_x10, request.size_class) for request in made.of(do.RequestBegin)]


def end(made, sequence):
    """Have the inspection under way end, and its result acknowledged."""
    made.feed(ev.BeginAnswered, made.state.pending.number, BeginReply(sequence=sequence, deadline_s=2.0))
    made.write("enable")
    trigger_id, size = made.state.running.trigger_id, made.state.running
    outcome = made.outcome(sequence=sequence, trigger_id=trigger_id).model_copy(
        update={"fruit_length_mm_x10": size.fruit_length_mm_x10, "size_class": size.size_class}
    )
    made.feed(ev.OutcomeReceived, outcome)
    made.write("enable", acknowledged_sequence=sequence)


def test_a_size_may_come_with_the_trigger_or_before_it(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=1, fruit_length_mm_x10=480, size_class=3)
    end(made, 101)
    made.feed(ev.PlcWrote, made.inputs, frozenset({"plc_heartbeat"}))
    made.write("enable", fruit_length_mm_x10=455)
    made.write("enable", size_class=2)
    made.feed(ev.PlcWrote, made.inputs, frozenset({"plc_heartbeat"}))
    made.write("enable", "trigger", trigger_id=2)
    assert requested_sizes(made) == [(480, 3), (455, 2)]


def test_a_size_that_is_not_written_again_is_not_the_next_fruits_and_the_same_one_written_again_is(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=1, fruit_length_mm_x10=480, size_class=3)
    end(made, 101)
    made.write("enable", "trigger", trigger_id=2)
    end(made, 102)
    made.write("enable", "trigger", trigger_id=3, fruit_length_mm_x10=480)
    assert made.inputs.size_class == 3, "it is still in its register"
    assert requested_sizes(made) == [(480, 3), NONE, (480, 0)]


def test_a_refused_trigger_uses_the_size_up_as_well(bench):
    made = bench()
    made.armed()
    made.write("enable", "trigger", trigger_id=0, fruit_length_mm_x10=300)
    assert made.state.last_refusal is Refusal.BAD_TRIGGER_ID
    made.write("enable")
    made.write("enable", "trigger", trigger_id=2)
    assert requested_sizes(made) == [NONE]


@pytest.mark.parametrize("written", ["before", "with a trigger bit that is still up"])
def test_a_size_of_another_writer_is_forgotten(bench, written):
    made = bench()
    made.armed()
    if written == "before":
        made.write("enable", fruit_length_mm_x10=300)
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
        made.write()
    else:
        made.write("enable", "trigger", trigger_id=1)
        end(made, 101)
        made.feed(ev.WriterWithdrawn)
        made.feed(ev.WriterGranted)
        made.write("trigger", trigger_id=1, fruit_length_mm_x10=300)
        made.write()
    made.write("enable")
    made.write("enable", "trigger", trigger_id=2)
    assert requested_sizes(made)[-1] == NONE
    assert made.state.size == Size()
