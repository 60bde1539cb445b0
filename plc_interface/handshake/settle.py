"""Resynchronisation after a start or a lost connection: the station's open inspections against the PLC's."""

from plc_interface.handshake.actions import AskOutcome, TellPublished
from plc_interface.handshake.events import OpenTold
from plc_interface.handshake.inspection import run, unknown_run
from plc_interface.handshake.modes import Signal
from plc_interface.handshake.state import NO_SIZE, Asked
from plc_interface.handshake.verdict import (
    acknowledge,
    give,
    hide,
    in_place_of,
    is_sound,
    no_result,
    pass_over_hidden,
    queue,
)
from plc_interface.handshake.work import Work
from station.channel.line import Open, Outcome, Reason

RESUMED_DEADLINE_S = 60.0
"""For an inspection whose acceptance, with its deadline, was lost with the interface."""


def settle(work: Work) -> None:
    """Continue the PLC's inspections, cancel the others, publish final outcomes."""
    if not isinstance(work.event, OpenTold):
        return
    state, opened = work.state, work.event.opened
    state.open_asked = None
    stands = {outcome.sequence: outcome for outcome in (*state.journal.verdicts, *state.queue)}
    work.actions += [TellPublished(stands[sequence]) for sequence in sorted(stands)]
    for outcome in sorted(opened.outcomes, key=lambda outcome: outcome.sequence):
        _settle_outcome(work, outcome, known=outcome.sequence in stands)
    if opened.running is not None:
        _settle_running(work, *opened.running, known=opened.running[0] in stands)
    if state.running is not None and not _is_open(opened, state.running.sequence):
        work.signals.append(Signal.GONE)
    pass_over_hidden(work)
    state.adopted = True
    work.say("the station answers, and what was open is settled", warning=False)


def _is_open(opened: Open, sequence: int) -> bool:
    running = opened.running is not None and opened.running[0] == sequence
    return running or any(outcome.sequence == sequence for outcome in opened.outcomes)


def _settle_outcome(work: Work, outcome: Outcome, *, known: bool) -> None:
    state, journal = work.state, work.state.journal
    sequence = outcome.sequence
    if state.running is not None and sequence == state.running.sequence:
        work.found = outcome
        work.signals.append(Signal.OUTCOME)
    elif sequence <= journal.acknowledged:
        acknowledge(work, journal.acknowledged)
    elif known or _may_be_asked_for(work, sequence):
        return
    elif _is_the_plcs(work, sequence, outcome.trigger_id):
        work.keep(highest=sequence, accepted_id=outcome.trigger_id)
        if is_sound(outcome):
            queue(work, outcome)
        else:
            give(work, in_place_of(outcome, Reason.INTERNAL_FAULT))
    else:
        hide(work, in_place_of(outcome, Reason.STATION_LOST))


def _settle_running(work: Work, sequence: int, trigger_id: int, *, known: bool) -> None:
    state, journal = work.state, work.state.journal
    asked = Asked(0, trigger_id, 0, journal.lot, NO_SIZE)
    if state.running is not None and sequence == state.running.sequence:
        work.actions.append(AskOutcome(sequence, state.running.within_s))
    elif sequence <= journal.acknowledged:
        acknowledge(work, journal.acknowledged)
    elif known or _may_be_asked_for(work, sequence):
        return
    elif _is_the_plcs(work, sequence, trigger_id) and state.running is None:
        run(work, sequence, asked, RESUMED_DEADLINE_S)
        work.signals.append(Signal.RESUMED_RUN)
    else:
        hide(work, no_result(unknown_run(asked, sequence, work.at), work.at, Reason.STATION_LOST))


def _may_be_asked_for(work: Work, sequence: int) -> bool:
    """Return whether it may be the inspection of the pending `Begin`, whose answer decides."""
    return work.state.asked is not None and sequence > work.state.journal.highest


def _is_the_plcs(work: Work, sequence: int, trigger_id: int) -> bool:
    """Return whether an unknown inspection was accepted before this start, and its journal was lost since.

    After resynchronisation every accepted sequence is known, so an unknown one belongs to a refused trigger.
    """
    state, journal = work.state, work.state.journal
    return not state.adopted and sequence > journal.highest and trigger_id not in journal.disowned
