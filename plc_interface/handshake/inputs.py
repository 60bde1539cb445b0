"""Inputs: conversion of events to the signals of the table."""

from collections.abc import Callable
from typing import Any

from plc_interface.handshake.events import (
    Beat,
    BeginAnswered,
    BeginFailed,
    CommandAnswered,
    CommandFailed,
    OpenAnswered,
    OutcomeFailed,
    OutcomeNoted,
    OutcomeReceived,
    OutputChanged,
    PlcWrote,
    RequestFailed,
    ShuttingDown,
    Tick,
    WriterGranted,
    WriterWithdrawn,
)
from plc_interface.handshake.modes import Result, Signal
from plc_interface.handshake.results import take_unwritten
from plc_interface.handshake.state import NO_SIZE, Size
from plc_interface.handshake.work import Work

EDGES: tuple[tuple[str, Signal, Signal | None], ...] = (
    ("offline", Signal.OFFLINE_ON, Signal.OFFLINE_OFF),
    ("enable", Signal.ENABLE_ON, Signal.ENABLE_OFF),
    ("latch_lot", Signal.LATCH_ON, Signal.LATCH_OFF),
    ("clear_error", Signal.CLEAR_ON, None),
    ("reset_counters", Signal.RESET_ON, None),
)
"""The bits in the order in which those of one write count; the acknowledgement, the command and the trigger follow."""


def apply_event(work: Work) -> None:
    """Store the event's data in the state and queue its signals."""
    _HANDLERS[type(work.event)](work, work.event)


def _writer_granted(work: Work, _event: WriterGranted) -> None:
    work.state.writer = True
    work.state.seen = work.state.last_heartbeat = None


def _writer_withdrawn(work: Work, _event: WriterWithdrawn) -> None:
    work.state.writer = False
    work.state.seen = work.state.last_heartbeat = None
    # The next writer's fruit must not be judged by this one's size.
    work.state.size = NO_SIZE
    work.stop(Signal.PLC_SILENT)
    work.signals.append(Signal.WRITER_LOST)


def _beat(work: Work, event: Beat) -> None:
    same = event.station.boot == work.state.last_boot
    work.signals.append(Signal.STATION_ANSWERED if same else Signal.STATION_RESTARTED)


def _output_changed(work: Work, event: OutputChanged) -> None:
    work.state.diverts = event.ready


def _outcome_received(work: Work, event: OutcomeReceived) -> None:
    running = work.state.running
    work.found = event.outcome
    mine = running is not None and running.sequence == event.outcome.sequence
    work.signals.append(Signal.OUTCOME if mine else Signal.FOREIGN_OUTCOME)


def _request_failed(work: Work, event: RequestFailed) -> None:
    if event.what != work.state.last_failure:
        work.log(f"the station did not answer as it has to: {event.what}")
    work.state.last_failure = event.what
    work.signals.append(Signal.CHANNEL_FAILED)


def _outcome_failed(work: Work, event: OutcomeFailed) -> None:
    running = work.state.running
    if running is not None and running.sequence == event.sequence:
        work.log(f"inspection {event.sequence}: the station did not give its outcome: {event.what}")
        work.signals.append(Signal.CHANNEL_FAILED)


def _open_answered(work: Work, event: OpenAnswered) -> None:
    if event.number == work.state.open_request:
        work.signals.append(Signal.OPENED)


def _outcome_noted(work: Work, event: OutcomeNoted) -> None:
    verdicts = work.state.journal.verdicts
    work.update_journal(verdicts=tuple(outcome for outcome in verdicts if outcome.sequence != event.sequence))


def _plc_wrote(work: Work, event: PlcWrote) -> None:
    state, before, seen = work.state, work.state.inputs, work.state.seen
    state.inputs = event.inputs
    _watch_heartbeat(work, event)
    rose: frozenset[str] = frozenset()
    fell: frozenset[str] = frozenset()
    if "control" in event.written:
        control = event.inputs.control
        state.seen = control
        rose = control - (seen or frozenset())
        # A low bit in a writer's first write counts as fallen: `enable` written 0 there and then 1 arms.
        fell = frozenset(bit for bit in _BITS if bit not in control and (seen is None or bit in seen))
        if seen is None:  # a bit that was high all along is no order to clear or to reset
            rose -= {"clear_error", "reset_counters"}
    _apply_size(work, event, by_trigger="trigger" in rose)
    for bit, on, off in EDGES:
        if bit in rose:
            work.signals.append(on)
        elif bit in fell and off is not None:
            work.signals.append(off)
    # Before the acknowledgement is evaluated: what the PLC had taken before this start is no wrong one.
    _apply_first_write(work, event)
    changed = event.inputs.acknowledged_sequence not in {before.acknowledged_sequence, 0}
    acknowledged = state.journal.acknowledged
    had = {acknowledged, state.journal.plc_taken or acknowledged, state.taken or acknowledged}
    # A bit that is high in a writer's first write, with the number of what the PLC took, is no wrong acknowledgement.
    left_high = seen is None and event.inputs.acknowledged_sequence in had
    _acknowledged(work, event, rose, changed=changed, left_high=left_high)
    if "acknowledge" in fell:
        work.signals.append(Signal.ACKNOWLEDGE_OFF)
    held = seen is None and _is_answered_or_pending(work, event.inputs.trigger_id)
    for bit, on, off in (
        ("execute_command", Signal.EXECUTE_ON, Signal.EXECUTE_OFF),
        ("trigger", Signal.TRIGGER_HELD if held else Signal.TRIGGER_ON, Signal.TRIGGER_OFF),
    ):
        if bit in rose or bit in fell:
            work.signals.append(on if bit in rose else off)


def _watch_heartbeat(work: Work, event: PlcWrote) -> None:
    """Monitor a heartbeat once this writer has changed it."""
    if "plc_heartbeat" not in event.written:
        return
    if work.state.last_heartbeat not in {None, event.inputs.plc_heartbeat}:
        work.start(Signal.PLC_SILENT, work.settings.plc_heartbeat_timeout_s)
    work.state.last_heartbeat = event.inputs.plc_heartbeat


_BITS = frozenset({*(bit for bit, _, off in EDGES if off), "acknowledge", "execute_command", "trigger"})


def _apply_first_write(work: Work, event: PlcWrote) -> None:
    """Take what the PLC had taken before this start; a write of neither of its registers says nothing of that."""
    if work.state.result is Result.WITHHELD and not event.written.isdisjoint({"acknowledged_sequence", "control"}):
        take_unwritten(work, event.inputs.acknowledged_sequence)
        work.signals.append(Signal.FIRST_WRITE)


def _apply_size(work: Work, event: PlcWrote, *, by_trigger: bool) -> None:
    """Store a written size; a trigger uses it up, accepted or refused.

    A size is valid for one trigger after it was written. So a PLC may write the size before the trigger or with it, and
    if it stops writing it, no fruit is judged by the size of another.
    """
    written = {name: getattr(event.inputs, name) for name in Size._fields if name in event.written}
    size = work.state.size._replace(**written)
    work.size, work.state.size = (size, NO_SIZE) if by_trigger else (NO_SIZE, size)


def _is_answered_or_pending(work: Work, trigger_id: int) -> bool:
    """Return whether a trigger bit that is high with this id in a writer's first write is no new trigger."""
    pending = work.state.pending
    return trigger_id != 0 and trigger_id == (pending.trigger_id if pending else work.state.journal.accepted_id)


def _acknowledged(work: Work, event: PlcWrote, rose: frozenset[str], *, changed: bool, left_high: bool) -> None:
    """Queue the signal of a written sequence or of the acknowledge bit, whose rise alone is not enough.

    A PLC that writes the sequence first and sets its bit then waits for result_valid to fall all the same.
    """
    state, sequence = work.state, event.inputs.acknowledged_sequence
    by_bit, written = "acknowledge" in rose, "acknowledged_sequence" in event.written
    after = by_bit and sequence == state.unconfirmed
    if by_bit:
        state.unconfirmed = 0
    if (by_bit or written) and state.queue and sequence == state.queue[0].sequence == state.published:
        work.signals.append(Signal.ACKNOWLEDGED)
    elif after and sequence:
        work.signals.append(Signal.ACKNOWLEDGE_AFTER)
    elif (by_bit and not left_high) or (
        changed and sequence not in {state.journal.acknowledged, state.journal.plc_taken, state.taken}
    ):
        if state.journal.acknowledged < sequence <= state.journal.highest:
            work.update_journal(disbelieved=sequence)
        work.signals.append(Signal.WRONG_ACKNOWLEDGEMENT)


def _begin_answered(work: Work, event: BeginAnswered | BeginFailed) -> None:
    if work.state.pending is None or work.state.pending.number != event.number:
        return
    if isinstance(event, BeginFailed):
        work.signals += [Signal.BEGIN_FAILED, Signal.CHANNEL_FAILED]
    elif event.begun.sequence is not None and event.begun.refusal is None:
        work.signals.append(Signal.BEGUN)
    else:
        work.signals.append(Signal.BEGIN_REFUSED)


def _command_answered(work: Work, event: CommandAnswered | CommandFailed) -> None:
    if event.number != work.state.command_request:
        return
    if isinstance(event, CommandFailed):
        work.signals.append(Signal.COMMAND_FAILED)
    elif event.done:
        work.signals.append(Signal.COMMAND_DONE)
    else:
        work.log(f"the station did not carry out the PLC's command: {event.why}")
        work.signals.append(Signal.COMMAND_REFUSED)


_HANDLERS: dict[type, Callable[[Work, Any], None]] = {
    PlcWrote: _plc_wrote,
    WriterGranted: _writer_granted,
    WriterWithdrawn: _writer_withdrawn,
    Tick: lambda _work, _event: None,
    Beat: _beat,
    OutputChanged: _output_changed,
    BeginAnswered: _begin_answered,
    BeginFailed: _begin_answered,
    OutcomeReceived: _outcome_received,
    OutcomeFailed: _outcome_failed,
    RequestFailed: _request_failed,
    OpenAnswered: _open_answered,
    OutcomeNoted: _outcome_noted,
    CommandAnswered: _command_answered,
    CommandFailed: _command_answered,
    ShuttingDown: lambda work, _event: work.signals.append(Signal.SHUTTING_DOWN),
}
