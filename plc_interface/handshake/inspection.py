"""The one inspection that can be in progress, from the request to the station to its final outcome."""

from collections.abc import Callable

from plc_interface.handshake.actions import RequestBegin, RequestOutcome
from plc_interface.handshake.events import BeginAnswered, Moment
from plc_interface.handshake.journal import MOST_DISOWNED, Running
from plc_interface.handshake.modes import Inspection, Signal
from plc_interface.handshake.outcomes import is_sound, no_result, publish_if_other, publish_own, queue
from plc_interface.handshake.trigger import note_refusal
from plc_interface.handshake.work import Work, described, row
from station.channel.line import BeginReply, Reason, Refusal, StationState
from station.vocabulary import PackmlState


def request_begin(work: Work) -> None:
    """`Begin` to the station."""
    state = work.state
    inputs = state.inputs
    state.pending = RequestBegin(work.number(), inputs.trigger_id, inputs.encoder, state.journal.lot, *work.size)
    work.actions.append(state.pending)


def is_new(work: Work) -> bool:
    """The sequence is higher than any before."""
    event = work.event
    return isinstance(event, BeginAnswered) and (event.begun.sequence or 0) > work.state.journal.highest


def accept(work: Work) -> None:
    """Accept the id under the sequence, `acquiring`, start the deadline, `AwaitOutcome`."""
    state, event, pending = work.state, work.event, work.state.pending
    if not isinstance(event, BeginAnswered) or event.begun.sequence is None or pending is None:
        return
    state.missed = False
    work.count("count_triggers", "count_accepted")
    work.update_journal(disowned=())
    run(work, event.begun.sequence, pending, event.begun.deadline_s)
    state.open_request = None  # its answer may be older than this inspection
    work.signals.append(Signal.ACCEPTED)


def run(work: Work, sequence: int, pending: RequestBegin, deadline_s: float) -> None:
    """Register an inspection as running, with the interface's own deadline behind the station's."""
    state, station = work.state, work.state.station
    within_s = deadline_s + work.settings.result_margin_s
    state.pending = None
    state.acquiring = True
    _await_news(work, PackmlState.STARTING)
    state.running = running(pending, sequence, work.at, within_s, station)
    if state.taken == sequence:
        state.taken = 0  # what runs has no outcome yet: the PLC's number was wrong, or of another station
    # Written before there was an outcome to take: at the next start this number must not take it.
    if state.inputs.acknowledged_sequence == sequence:
        work.update_journal(disbelieved=sequence)
    work.update_journal(accepted_id=pending.trigger_id, highest=sequence)
    work.start(Signal.RESULT_DEADLINE, within_s)
    work.actions.append(RequestOutcome(sequence, within_s))


def _await_news(work: Work, packml_state: PackmlState | None) -> None:
    """Take the station for not ready, in a PackML state, until a beat that is sent from now on reports its state.

    Else a loss of the beats alone would show the readiness of before the trigger, with the jaws on the fruit.
    """
    state = work.state
    state.news_from_s = work.at.s
    if state.station is not None:
        state.station = state.station.model_copy(update={"ready": False, "packml_state": packml_state})


def running(
    pending: RequestBegin, sequence: int, at: Moment, within_s: float = 0.0, station: StationState | None = None
) -> Running:
    """Make an inspection that began now, by the station's recipe as far as it is known."""
    return Running(
        sequence=sequence,
        trigger_id=pending.trigger_id,
        encoder=pending.encoder,
        lot=pending.lot,
        fruit_length_mm_x10=pending.fruit_length_mm_x10,
        size_class=pending.size_class,
        within_s=within_s,
        began_s=at.s,
        began_utc_ms=at.utc_ms,
        recipe_number=station.recipe_number if station else 0,
        recipe_checksum=station.recipe_checksum if station else 0,
        simulated=station.simulated if station else False,
    )


def refuse_as_answered(work: Work) -> None:
    """Refuse with the station's reason."""
    event = work.event
    begun = event.begun if isinstance(event, BeginAnswered) else BeginReply()
    _await_news(work, work.state.station.packml_state if work.state.station else None)
    refuse_pending(work, begun.refusal or Refusal.NOT_READY)
    if begun.refusal is Refusal.BUSY:
        work.signals.append(Signal.STATION_BUSY)


def refuse_pending(work: Work, reason: Refusal) -> None:
    """Refuse the trigger of the pending `Begin`."""
    pending, work.state.pending = work.state.pending, None
    if pending is not None:
        note_refusal(work, reason, pending.trigger_id)
    work.signals.append(Signal.REFUSED)


def refuse_reused_sequence(work: Work) -> None:
    """Refuse as not ready, `acquiring`: the station used a sequence twice."""
    # By its answer it has begun, so that its arm may be on the way to the fruit.
    work.state.acquiring = True
    _await_news(work, None)
    work.log("the station gave a sequence again, or a lower one: its records were changed; the trigger is refused")
    refuse_pending(work, Refusal.NOT_READY)


def refuse_as_lost(work: Work) -> None:
    """Refuse as station lost, `acquiring`; if the station began it, its result is never published."""
    pending = work.state.pending
    # The station may have begun it, and its arm may be on the way to the fruit.
    work.state.acquiring = True
    _await_news(work, None)
    if pending is not None:
        # Only this journal has the refusal: without it a start after a loss of power would adopt the inspection.
        work.durable = True
        work.update_journal(disowned=(*work.state.journal.disowned, pending.trigger_id)[-MOST_DISOWNED:])
    refuse_pending(work, Refusal.STATION_LOST)


def is_its_outcome(work: Work) -> bool:
    """Id and content are sound."""
    running, outcome = work.state.running, work.found
    return (
        running is not None and outcome is not None and outcome.trigger_id == running.trigger_id and is_sound(outcome)
    )


def end_run(work: Work) -> Running | None:
    """End the running inspection, and return it."""
    running, work.state.running = work.state.running, None
    work.stop(Signal.RESULT_DEADLINE)
    return running


def publish(work: Work) -> None:
    """The station's outcome is final, `Published`."""
    end_run(work)
    if work.found is not None:
        queue(work, work.found)


def _ending(words: str, *reasons: Reason) -> Callable[[Work], None]:
    def give_no_result(work: Work) -> None:
        running = end_run(work)
        if running is not None:
            work.log(f"inspection {running.sequence}: NO_RESULT ({', '.join(reasons)})")
            publish_own(work, no_result(running, work.at, *reasons))

    return described(words, give_no_result)


late = _ending("NO_RESULT (late) is final, `Published`.", Reason.LATE)
lost = _ending("NO_RESULT (station lost) is final, `Published`.", Reason.STATION_LOST)
unsound = _ending("NO_RESULT (internal fault) is final, `Published`.", Reason.INTERNAL_FAULT)


def drop(work: Work) -> None:
    """Drop it; `Published` if another one is final under its sequence."""
    if work.found is not None:
        publish_if_other(work, work.found)


NONE, BEGINNING, RUNNING = Inspection.NONE, Inspection.BEGINNING, Inspection.RUNNING

ROWS = (
    row(NONE, Signal.BEGIN, request_begin, to=BEGINNING),
    row(NONE, Signal.RESUMED_RUN, to=RUNNING),
    row(NONE, Signal.FOREIGN_OUTCOME, drop),
    row(NONE, Signal.STATION_SILENT),
    row(NONE, Signal.STATION_RESTARTED),
    row(BEGINNING, Signal.BEGUN, accept, to=RUNNING, when=is_new),
    row(BEGINNING, Signal.BEGUN, refuse_reused_sequence, to=NONE),
    row(BEGINNING, Signal.BEGIN_REFUSED, refuse_as_answered, to=NONE),
    row(BEGINNING, Signal.BEGIN_FAILED, refuse_as_lost, to=NONE),
    row(BEGINNING, Signal.STATION_SILENT, refuse_as_lost, to=NONE),
    row(BEGINNING, Signal.STATION_RESTARTED, refuse_as_lost, to=NONE),
    row(BEGINNING, Signal.FOREIGN_OUTCOME, drop),
    row(RUNNING, Signal.OUTCOME, publish, to=NONE, when=is_its_outcome),
    row(RUNNING, Signal.OUTCOME, unsound, to=NONE),
    row(RUNNING, Signal.RESULT_DEADLINE, late, to=NONE),
    row(RUNNING, Signal.STATION_SILENT, lost, to=NONE),
    row(RUNNING, Signal.GONE, lost, to=NONE),
    row(RUNNING, Signal.STATION_RESTARTED),
    row(RUNNING, Signal.FOREIGN_OUTCOME, drop),
)
