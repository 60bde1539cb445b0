"""Outcomes: those of the interface itself, and publication of every outcome to the PLC."""

from plc_interface.handshake.actions import ForwardOutcome, NotifyAcknowledged, NotifyPublished
from plc_interface.handshake.events import Moment
from plc_interface.handshake.journal import Running
from plc_interface.handshake.modes import Signal
from plc_interface.handshake.work import Work
from station.channel.line import Outcome, Reason

MOST_UNNOTED = 64
"""Maximum number of outcomes that a station has not noted."""

_COUNTED = {"PASS": "count_pass", "FAIL": "count_fail", "NO_RESULT": "count_no_result"}


def no_result(running: Running, at: Moment, *reasons: Reason) -> Outcome:
    """Make NO_RESULT for an inspection whose outcome the station did not give, or not in time.

    Args:
        at: the inspection's end.
        reasons: LATE marks the outcome as late.
    """
    return Outcome(
        **running.model_dump(exclude={"within_s", "began_s"}),
        outcome="NO_RESULT",
        reasons=reasons,
        late=Reason.LATE in reasons,
        partial=True,
        area_mm2=None,
        area_px=None,
        closing_mm=None,
        confidence=None,
        ended_utc_ms=at.utc_ms,
        # After a restart it is counted by UTC: a clock that was set must not give more than the register holds.
        duration_ms=max(0, min(round(1000 * (at.s - running.began_s)), 2**32 - 1)),
    )


def in_place_of(outcome: Outcome, reason: Reason) -> Outcome:
    """Make NO_RESULT that replaces an unusable outcome of the station."""
    nothing = {"area_mm2": None, "area_px": None, "closing_mm": None, "confidence": None}
    return outcome.model_copy(update={"outcome": "NO_RESULT", "reasons": (reason,), "late": False, **nothing})


def is_sound(outcome: Outcome) -> bool:
    """Return whether an outcome is consistent: PASS without a reason and in time, all others with a reason."""
    if outcome.outcome == "PASS":
        return not outcome.reasons and not outcome.late
    return bool(outcome.reasons)


def queue(work: Work, outcome: Outcome) -> None:
    """Queue an outcome for the PLC and publish it. From here on it is final.

    It stays in the journal until the station has noted it: the PLC may have taken it long before.
    """
    state = work.state
    if outcome.sequence == state.taken:  # by the PLC, before this start
        work.actions.append(NotifyPublished(outcome))
        acknowledge(work, outcome.sequence)
        return
    state.queue = (*state.queue, outcome)
    work.update_journal(verdicts=(*state.journal.verdicts, outcome)[-MOST_UNNOTED:])
    work.count(_COUNTED[outcome.outcome], *(("count_late",) if outcome.late else ()))
    work.actions += [ForwardOutcome(outcome), NotifyPublished(outcome)]
    work.signals.append(Signal.QUEUED)


def publish_own(work: Work, outcome: Outcome) -> None:
    """Publish the interface's own outcome; it survives a restart, until the station has noted it."""
    work.durable = True
    queue(work, outcome)


def hide(work: Work, outcome: Outcome) -> None:
    """Close an inspection whose trigger was refused: NO_RESULT for the station, nothing for the PLC.

    Its sequence is used up: in answer to a later trigger it is refused, not taken for that trigger's fruit.
    """
    journal = work.state.journal
    if outcome.sequence in journal.hidden:
        return  # and the station has noted it
    work.log(f"inspection {outcome.sequence} belongs to a trigger that was refused: it is aborted")
    work.durable = True
    disowned = list(journal.disowned)
    if outcome.trigger_id in disowned:
        disowned.remove(outcome.trigger_id)
    work.update_journal(
        disowned=tuple(disowned),
        verdicts=(*journal.verdicts, outcome)[-MOST_UNNOTED:],
        hidden=(*journal.hidden, outcome.sequence),
        highest=max(journal.highest, outcome.sequence),
    )
    work.actions.append(NotifyPublished(outcome))


def pass_over_hidden(work: Work) -> None:
    """Acknowledge hidden sequences as soon as nothing older waits for the PLC, which cannot acknowledge these."""
    state = work.state
    waiting = [outcome.sequence for outcome in state.queue] + ([state.running.sequence] if state.running else [])
    oldest = min(waiting, default=2**32)
    passed = [sequence for sequence in state.journal.hidden if sequence < oldest]
    if passed:
        journal = state.journal
        plc_taken = journal.acknowledged if journal.plc_taken is None else journal.plc_taken
        acknowledge(work, max(passed))
        left = tuple(sequence for sequence in state.journal.hidden if sequence not in passed)
        work.update_journal(hidden=left, plc_taken=plc_taken)


def acknowledge(work: Work, sequence: int) -> None:
    """Record that the PLC has taken everything up to here, and notify the station."""
    if sequence > work.state.journal.acknowledged:
        work.update_journal(acknowledged=sequence, plc_taken=None)
    work.actions.append(NotifyAcknowledged(work.state.journal.acknowledged))


def publish_if_other(work: Work, theirs: Outcome) -> None:
    """Send the final outcome to the station, if it holds another one of the same sequence."""
    for ours in (*work.state.journal.verdicts, *work.state.queue):
        if ours.sequence == theirs.sequence:
            if ours != theirs:
                work.log(f"inspection {ours.sequence}: {theirs.outcome} came after {ours.outcome}, which is final")
                work.actions.append(NotifyPublished(ours))
            return
