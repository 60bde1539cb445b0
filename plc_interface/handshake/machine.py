"""One step of the handshake: from state and event to the next state and the actions."""

import copy

from plc_interface.handshake.actions import Action, SaveJournal
from plc_interface.handshake.events import Event
from plc_interface.handshake.inputs import apply_event
from plc_interface.handshake.modes import TIMERS, Signal
from plc_interface.handshake.state import State
from plc_interface.handshake.table import apply
from plc_interface.handshake.work import Work
from station.settings.plc import HandshakeSettings


def step(before: State, event: Event, settings: HandshakeSettings) -> tuple[State, tuple[Action, ...]]:
    """Return the state after an event, and the actions in their order.

    Timers that ran out before the event are handled first, then the event. `before` is not changed.

    Args:
        event: with its time, which never goes back.
    """
    # A shallow copy is enough: effects replace the values of a state, and change none in place.
    work = Work(copy.copy(before), event.at, event, settings)
    while (due := _due(work)) is not None:
        work.stop(due)
        work.signals.append(due)
        _run(work)
    apply_event(work)
    _run(work)
    state = work.state
    asked_id = state.pending.trigger_id if state.pending else None
    work.update_journal(queue=state.queue, running=state.running, asked_id=asked_id)
    if state.journal == before.journal:
        return state, tuple(work.actions)
    return state, (SaveJournal(state.journal, work.durable), *work.actions)


def next_due_s(state: State) -> float | None:
    """Return when the next timer runs out, on the monotonic clock; None if none runs. Step with a `Tick` then."""
    return min(state.timers.values(), default=None)


def _due(work: Work) -> Signal | None:
    due = [(due_s, TIMERS.index(timer), timer) for timer, due_s in work.state.timers.items() if due_s <= work.at.s]
    return min(due)[2] if due else None


def _run(work: Work) -> None:
    while work.signals:
        apply(work, work.signals.popleft())
