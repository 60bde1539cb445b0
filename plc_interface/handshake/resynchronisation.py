"""Resynchronisation after a start or a lost connection: the station's open inspections against the PLC's."""

from plc_interface.handshake.actions import NotifyPublished, RequestBegin, RequestOutcome
from plc_interface.handshake.events import OpenAnswered
from plc_interface.handshake.inspection import run, running
from plc_interface.handshake.modes import Signal
from plc_interface.handshake.outcomes import (
    acknowledge,
    hide,
    in_place_of,
    is_sound,
    no_result,
    pass_over_hidden,
    publish_own,
    queue,
)
from plc_interface.handshake.state import NO_SIZE
from plc_interface.handshake.work import Work
from station.channel.line import Open, Outcome, Reason

RESUMED_DEADLINE_S = 60.0
"""For an inspection whose acceptance, with its deadline, was lost with the interface."""


def resynchronise(work: Work) -> None:
    """Continue the PLC's inspections, cancel the others, publish final outcomes."""
    if not isinstance(work.event, OpenAnswered):
        return
    state, opened = work.state, work.event.opened
    state.open_request, state.last_failure = None, ""
    final = {outcome.sequence: outcome for outcome in (*state.journal.verdicts, *state.queue)}
    # Notes may have been lost with the link. Outcomes come before acknowledgements: the station acknowledges only what
    # it has noted as published.
    work.actions += [NotifyPublished(final[sequence]) for sequence in sorted(final)]
    for outcome in sorted(opened.outcomes, key=lambda outcome: outcome.sequence):
        _resynchronise_outcome(work, outcome, known=outcome.sequence in final)
    if opened.running is not None:
        _resynchronise_running(work, *opened.running, known=opened.running[0] in final)
    if state.running is not None and not _is_open(opened, state.running.sequence):
        work.signals.append(Signal.GONE)
    pass_over_hidden(work)
    state.adopted = True
    work.log("the station answers, and what was open is settled", warning=False)


def _is_open(opened: Open, sequence: int) -> bool:
    running = opened.running is not None and opened.running[0] == sequence
    return running or any(outcome.sequence == sequence for outcome in opened.outcomes)


def _resynchronise_outcome(work: Work, outcome: Outcome, *, known: bool) -> None:
    state, journal = work.state, work.state.journal
    sequence = outcome.sequence
    if state.running is not None and sequence == state.running.sequence:
        work.found = outcome
        work.signals.append(Signal.OUTCOME)
    elif sequence <= journal.acknowledged:  # taken, or never shown to the PLC; the station has missed that
        acknowledge(work, journal.acknowledged)
    elif known or _may_be_pending(work, sequence):
        return
    elif _is_the_plcs(work, sequence, outcome.trigger_id):
        work.update_journal(highest=sequence, accepted_id=outcome.trigger_id)
        if is_sound(outcome):
            queue(work, outcome)
        else:
            publish_own(work, in_place_of(outcome, Reason.INTERNAL_FAULT))
    else:
        hide(work, in_place_of(outcome, Reason.STATION_LOST))


def _resynchronise_running(work: Work, sequence: int, trigger_id: int, *, known: bool) -> None:
    state, journal = work.state, work.state.journal
    unknown = RequestBegin(0, trigger_id, 0, journal.lot, *NO_SIZE)
    if state.running is not None and sequence == state.running.sequence:
        work.actions.append(RequestOutcome(sequence, state.running.within_s))
    elif sequence <= journal.acknowledged:
        acknowledge(work, journal.acknowledged)
    elif known or _may_be_pending(work, sequence):
        return
    elif _is_the_plcs(work, sequence, trigger_id) and state.running is None:
        run(work, sequence, unknown, RESUMED_DEADLINE_S)
        work.signals.append(Signal.RESUMED_RUN)
    else:
        hide(work, no_result(running(unknown, sequence, work.at), work.at, Reason.STATION_LOST))


def _may_be_pending(work: Work, sequence: int) -> bool:
    """Return whether it may be the inspection of the pending `Begin`, whose answer decides."""
    return work.state.pending is not None and sequence > work.state.journal.highest


def _is_the_plcs(work: Work, sequence: int, trigger_id: int) -> bool:
    """Return whether an unknown inspection was accepted before this start, and its journal was lost since.

    After resynchronisation every accepted sequence is known, so an unknown one belongs to a refused trigger.
    """
    state, journal = work.state, work.state.journal
    return not state.adopted and sequence > journal.highest and trigger_id not in journal.disowned
