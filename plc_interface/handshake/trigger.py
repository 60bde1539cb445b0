"""The trigger bit and its acknowledgement."""

from plc_interface.handshake.modes import Arming, Command, Inspection, Link, Service, Signal, Trigger
from plc_interface.handshake.state import Fault, State
from plc_interface.handshake.work import Work, described, row
from station.channel.line import Refusal


def obstacle(state: State) -> Refusal | None:
    """Return why no trigger is accepted now, independent of its id; None where the request may go to the station."""
    waiting = len(state.queue)
    reasons: tuple[tuple[bool, Refusal], ...] = (
        (state.service is not Service.IN_SERVICE, Refusal.OFFLINE),
        (state.link is not Link.UP, Refusal.STATION_LOST),
        (state.arming is not Arming.ARMED, Refusal.NOT_ENABLED),
        (not state.diverts, Refusal.NOT_READY),
        (state.inspection is not Inspection.NONE, Refusal.BUSY),
        (waiting >= state.places, Refusal.QUEUE_FULL),
        (state.command is Command.EXECUTING and state.command_changes_recipe, Refusal.RECIPE_CHANGING),
    )
    return next((refusal for holds, refusal in reasons if holds), None)


def refusal(state: State) -> Refusal | None:
    """Return why the trigger with the present id is refused; None where the request goes to the station.

    A repeated id has precedence over all other reasons: no other refusal then names an id that was accepted.
    """
    if state.inputs.trigger_id in {0, state.journal.accepted_id, state.pending.trigger_id if state.pending else 0}:
        return Refusal.BAD_TRIGGER_ID
    return obstacle(state)


is_unobstructed = described("Nothing blocks the trigger.", lambda work: refusal(work.state) is None)
begin = described("Request an inspection.", lambda work: work.signals.append(Signal.BEGIN))


def note_refusal(work: Work, reason: Refusal, trigger_id: int) -> None:
    """Publish and count a refusal, with its reason and its id."""
    state = work.state
    state.last_refusal, state.last_refused_id, state.missed = reason, trigger_id, True
    work.count("count_triggers", "count_missed")
    if reason is Refusal.QUEUE_FULL:
        state.overrun = True
        work.count("count_overrun")
    work.log(f"trigger {trigger_id} refused: {reason.value}")


def refuse(work: Work) -> None:
    """Refuse with the reason."""
    note_refusal(work, refusal(work.state) or Refusal.NOT_READY, work.state.inputs.trigger_id)


watch = described("Start the trigger's time-out.", lambda work: work.watch_bit(Signal.TRIGGER_TIMEOUT))
end_watch = described("Stop the trigger's time-out.", lambda work: work.stop(Signal.TRIGGER_TIMEOUT))
not_reset = described("Fault: trigger bit not reset in time.", lambda work: work.fault(Fault.TRIGGER_NOT_RESET))


ROWS = (
    row(Trigger.LOW, Signal.TRIGGER_ON, begin, to=Trigger.PENDING, when=is_unobstructed),
    row(Trigger.LOW, Signal.TRIGGER_ON, refuse, watch, to=Trigger.ANSWERED),
    row(Trigger.LOW, Signal.TRIGGER_HELD, watch, to=Trigger.ANSWERED),
    row(Trigger.LOW, Signal.TRIGGER_OFF),
    row(Trigger.LOW, Signal.WRITER_LOST),
    row(Trigger.PENDING, Signal.ACCEPTED, watch, to=Trigger.ANSWERED),
    row(Trigger.PENDING, Signal.REFUSED, watch, to=Trigger.ANSWERED),
    row(Trigger.PENDING, Signal.TRIGGER_OFF, to=Trigger.PULSED),
    row(Trigger.PENDING, Signal.WRITER_LOST, to=Trigger.PULSED),
    row(Trigger.PULSED, Signal.ACCEPTED, watch, to=Trigger.HELD),
    row(Trigger.PULSED, Signal.REFUSED, watch, to=Trigger.HELD),
    row(Trigger.PULSED, Signal.TRIGGER_ON, refuse, to=Trigger.PENDING),
    row(Trigger.PULSED, Signal.TRIGGER_HELD, to=Trigger.PENDING),
    row(Trigger.PULSED, Signal.TRIGGER_OFF),
    row(Trigger.PULSED, Signal.WRITER_LOST),
    row(Trigger.ANSWERED, Signal.TRIGGER_OFF, end_watch, to=Trigger.LOW),
    row(Trigger.ANSWERED, Signal.WRITER_LOST, end_watch, to=Trigger.LOW),
    row(Trigger.ANSWERED, Signal.TRIGGER_TIMEOUT, not_reset, to=Trigger.STUCK),
    row(Trigger.HELD, Signal.TRIGGER_ON, end_watch, begin, to=Trigger.PENDING, when=is_unobstructed),
    row(Trigger.HELD, Signal.TRIGGER_ON, refuse, watch, to=Trigger.ANSWERED),
    row(Trigger.HELD, Signal.TRIGGER_HELD, watch, to=Trigger.ANSWERED),
    row(Trigger.HELD, Signal.TRIGGER_OFF),
    row(Trigger.HELD, Signal.TRIGGER_TIMEOUT, to=Trigger.LOW),
    row(Trigger.HELD, Signal.WRITER_LOST, end_watch, to=Trigger.LOW),
    row(Trigger.STUCK, Signal.TRIGGER_OFF, to=Trigger.LOW),
    row(Trigger.STUCK, Signal.WRITER_LOST, to=Trigger.LOW),
)
