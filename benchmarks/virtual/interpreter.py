"""Interpreter of the cycle's actions on the simulated clock, in place of the runner and the service's ticks."""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, cast

from station.channel.line import BeginReply
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import ACCEPTING, LATCHES, REASONS, Action, Cycle, Event, Raise, hold_after
from station.inspection.deadlines import late
from station.inspection.states import STATES, State
from station.messages.message import verbatim
from station.press.stop import may_decide
from station.records.errors import RecordsError
from station.runtime.alarms.manager import AlarmManager
from station.runtime.cycle.runner import event_of
from station.vocabulary import Reason, Refusal

from .cell import LIMITS, Cell, NoMetrics
from .clock import Timer
from .devices import Part
from .inspection import RECIPE
from .inspections import Inspections
from .laws import NOTHING_MOVES, LawBrokenError

_POLL_S, _PERSON_S = 0.25, 2.0
WORDS = verbatim("by the story")

_WORK: dict[Action, tuple[Part, float]] = {
    Action.OPEN_JAWS: ("gripper", 0.15),
    Action.FREE_FRUIT: ("gripper", 0.1),
    Action.GO_HOME: ("arm", 0.2),
    Action.CHECK_JAWS: ("gripper", 0.02),
    Action.APPROACH: ("arm", 0.2),
    Action.CLOSE_TO_ONSET: ("gripper", 0.2),
    Action.CENTRE: ("arm", 0.1),
    Action.CLOSE_STEP: ("gripper", 0.08),
    Action.SETTLE: ("vision", 0.05),
    Action.CAPTURE: ("camera", 0.05),
    Action.MEASURE: ("vision", 0.04),
    Action.JUDGE: ("vision", 0.001),
    Action.PLACE_ACCEPT: ("gripper", 0.15),
    Action.PLACE_REJECT: ("gripper", 0.15),
    Action.RECOVER_ARM: ("arm", 0.5),
    Action.RECORD_TRIGGER: ("disk", 0.004),
    Action.RECORD: ("disk", 0.008),
    Action.CLOSE_UNFINISHED: ("disk", 0.004),
}
"""What each action waits for, and about how long."""
MOTIONS = {action for action, (part, _) in _WORK.items() if part in {"arm", "gripper"}} - {
    Action.RECOVER_ARM,
    Action.CHECK_JAWS,
}
_ARM_LEAVES = {Action.APPROACH, Action.CENTRE}
_CLOSES = {Action.CLOSE_TO_ONSET, Action.CLOSE_STEP}
_OPENS = {Action.OPEN_JAWS, Action.FREE_FRUIT, Action.PLACE_ACCEPT, Action.PLACE_REJECT}


class Interpreter(Inspections):
    """The cycle's table, carried out."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.alive = True
        self.alarms = AlarmManager(cast("Any", NoMetrics()))
        self._hold = cell.hold
        self.cycle = Cycle(cell.hold)
        self._doing: dict[Action, Timer] = {}
        self._queue: deque[Event] = deque()
        self._busy = False
        self._entered_s = self._clock.s
        self._records_fault: RecordsError | None = None
        self._goes_on: Callable[[], None] | None = None
        self._late: Timer | None = None

    @property
    def state(self) -> State:
        """Present state of the cycle."""
        return self.cycle.state

    def post(self, event: Event) -> None:
        """Take an event, after those that came before."""
        self._queue.append(event)
        if self._busy:
            return
        self._busy = True
        while self._queue and self.alive:
            self._take(self._queue.popleft())
        self._busy = False

    def _take(self, event: Event) -> None:
        before, transition = self.state, self.cycle.leads_to(event)
        if transition is not None:
            hold = hold_after(event, transition.state, self._hold, carries=self.cell.carries)
            if hold is not self._hold:
                self._hold = hold
                if self.cell.devices.trouble("disk") != "full":
                    self.cell.hold = hold
        actions = self.cycle.on(event)
        if actions is None:
            if event is Event.TRIGGER:
                self._refuse(Event.TRIGGER)
            return
        if self.state is not before:
            self._entered(self.state)
        self._act(actions, event)
        moving = [action for action in self._doing if action in MOTIONS]
        self.cell.laws.cycle(before, event, self.state, moving)

    def _entered(self, state: State) -> None:
        self._entered_s = self._clock.s
        self._watch()
        if state is State.IDLE:
            self.alarms.clear(AlarmId.FRUIT_HELD)
        elif state is State.STOPPED:
            self._after(0.05, lambda: self.post(Event.RESET) if self.state is State.STOPPED else None)
        elif state in {State.LATCHED, State.CARRIED}:
            self._after(_PERSON_S, self._confirm)

    def _confirm(self) -> None:
        if self.state in {State.LATCHED, State.CARRIED}:
            self.alarms.reset()
            self.post(Event.PERSON_CONFIRMED)

    def _watch(self) -> None:
        """Wake when the state, or the inspection, has lasted too long."""
        if self._late is not None:
            self._late.cancel()
        dues = [LIMITS.phases_s[self.state]] if self.state in LIMITS.phases_s else []
        if self._now is not None and not self._now.standing and self.state not in ACCEPTING:
            dues.append(max(0.1, LIMITS.inspection_s - (self._clock.s - self._now.accepted_s)))
        if dues:
            self._late = self._after(min(dues) + 0.01, self._report_late)

    def _report_late(self) -> None:
        now = self._now
        if now is None:  # as in the service: only an inspection has deadlines
            return
        since_s = None if now.standing else self._clock.s - now.accepted_s
        found = late(LIMITS, self.state, self._clock.s - self._entered_s, since_s)
        if found is not None:
            self.post(found.event)

    def _act(self, actions: Any, because: Event) -> None:
        for act in actions:
            if isinstance(act, Raise):
                self.alarms.raise_(act.alarm, WORDS)
            elif act is Action.HALT:
                self._halt()
            else:
                self._perform(act, because)

    def _halt(self) -> None:
        for action in [action for action in self._doing if action is not Action.RECORD]:
            self._doing.pop(action).cancel()
        self._goes_on = None

    def _perform(self, action: Action, because: Event) -> None:
        if action is Action.READ_DEVICES:
            self._after(_POLL_S, self._poll)
        elif action is Action.ACCEPT_TRIGGER:
            self._accept()
        elif action is Action.REFUSE_TRIGGER:
            self._refuse(because)
        elif action is Action.CLOSE_AS_NO_RESULT:
            self._interrupt(REASONS[because])
        elif action is Action.PUBLISH:
            self._deliver(self._inspection)
        elif action is Action.CHECK_DEVICES:
            self._after(0.0, partial(self._check, self.state))
        elif action is Action.CLOSE_STEP and self._waits_for_measure():
            self._doing[action] = Timer(lambda: None)
            self._goes_on = partial(self._request, action)
        else:
            self._request(action)

    def _waits_for_measure(self) -> bool:
        now = self._inspection
        if not now.captured:
            return False
        return may_decide(RECIPE, now.captured[-1].closing_mm) and now.seen < len(now.captured)

    def _request(self, action: Action) -> None:
        """Send a request to the part that an action needs."""
        if action in _ARM_LEAVES and not self.cell.jaws_open:
            raise LawBrokenError(NOTHING_MOVES, f"{action} with jaws that may hold a fruit")
        part, takes_s = _WORK[action]
        if action in _CLOSES:
            self.cell.jaws_open = False
        delay_s, fault = self.cell.devices.request(part, takes_s)
        self._doing[action] = self._after(delay_s, partial(self._end, action, fault))

    def _end(self, action: Action, fault: Exception | None) -> None:
        self._doing.pop(action, None)
        if fault is not None:
            self._failed(action, fault)
            return
        if action in _OPENS or action is Action.GO_HOME:
            self.cell.jaws_open = True
        event = getattr(self, f"_{action.value}")()
        if event is not None:
            self.post(event)

    def _failed(self, action: Action, fault: Exception) -> None:
        event = event_of(fault)
        if isinstance(fault, RecordsError):
            self._records_fault = fault
            if action is Action.RECORD_TRIGGER and self._pending is not None:
                self._pending.answer(BeginReply(refusal=Refusal.RECORDS_FULL))
        self.post(event)

    def _accept(self) -> None:
        pending, self._pending = self._pending, None
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        self._now = pending.now
        self._take_on(pending)
        self._watch()

    def _refuse(self, because: Event) -> None:
        pending, self._pending = self._pending, None
        if pending is None:
            return
        if not pending.now.sequence:
            if (timer := self._doing.pop(Action.RECORD_TRIGGER, None)) is not None:
                timer.cancel()
            pending.answer(BeginReply(refusal=STATES[self.state].refusal or Refusal.NOT_READY))
            return
        self._take_on(pending)
        pending.now.interruptions.append(REASONS[because])
        if self.cell.devices.trouble("disk") != "full":
            self._close_unfinished()

    def _close_unfinished(self) -> Event:
        while (now := self._running) is not None:
            now.outcome = "NO_RESULT"
            if not now.interruptions:
                now.interruptions.append(Reason.RECORDS_FAULT)
            self._conclude(now)
            self._deliver(now)
        return Event.UNFINISHED_CLOSED

    def _poll(self) -> None:
        if self.state not in {State.UNKNOWN, State.HELD}:
            return
        devices = self.cell.devices
        faults = [fault for part in ("arm", "gripper", "camera") if (fault := devices.standing(part)) is not None]
        if self._records_fault is not None and devices.trouble("disk") != "full":
            self._records_fault = None
        latched = next((event for fault in faults if (event := event_of(fault)) in LATCHES), None)
        if latched is not None:
            self.post(latched)
        elif not faults and self._records_fault is None:
            self.post(Event.READY)
        else:
            self._after(_POLL_S, self._poll)

    def _check(self, requested_in: State) -> None:
        if self.state is not requested_in:
            return
        for part in ("arm", "gripper", "camera"):
            if (fault := self.cell.devices.standing(part)) is not None:
                self.post(event_of(fault))
                return
        self.post(Event.RECORDS_FAULT if self._records_fault is not None else Event.READY)

    def _after(self, delay_s: float, what: Callable[[], None]) -> Timer:
        return self._clock.after(delay_s, lambda: what() if self.alive else None)
