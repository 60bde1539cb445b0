"""Station on the simulated clock: the real cycle's table, deadlines, judge, stop criteria and alarm manager.

A plain interpreter of the cycle's actions stands in for the runner and the service, which wait by asyncio.
"""

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

from station.channel.line import BeginReply, Outcome, StationState
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import ACCEPTING, LATCHES, REASONS, UNJUDGED, Action, Cycle, Event, Raise, hold_after
from station.inspection.deadlines import Deadlines, Pace, deadlines, late
from station.inspection.second_press import needs_second_press
from station.inspection.states import STATES, State
from station.messages.message import verbatim
from station.press.stop import may_decide
from station.records.errors import RecordsError
from station.runtime.alarms.manager import AlarmManager
from station.runtime.alarms.outcome_monitor import OutcomeMonitor
from station.runtime.cycle.runner import event_of
from station.vocabulary import Reason, Refusal

from .clock import Clock, Timer
from .devices import Devices, Part
from .inspection import RECIPE, Fruit, Inspection, ends_steps, judged, point
from .laws import NOTHING_MOVES, LawBrokenError, Laws
from .records import MemoryRecords, Record

LIMITS: Deadlines = deadlines(RECIPE, Pace(30.0, 1.0, 2.0, 100.0, 85.0, 0.5, 0.1))
RECORD_NO_RESULT_S = 1.0
_POLL_S, _PERSON_S, _MONITOR_S = 0.25, 2.0, 0.1
_NUMBER = (RECIPE.plc_number, 77)
_WORDS = verbatim("by the story")

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


class NoMetrics:
    """Metrics that nobody reads."""

    def alarms(self, active: Any) -> None:
        """Take the active alarms."""


@dataclass(slots=True)
class Cell:
    """What outlives the station's process: the nest, the jaws, the disk's content."""

    clock: Clock
    rng: random.Random
    devices: Devices
    laws: Laws
    records: MemoryRecords
    carries: bool
    fruit: Fruit | None = None
    jaws_open: bool = False
    hold: Event | None = None
    """As it is in its file."""


@dataclass(slots=True)
class Pending:
    """A trigger between its request and its answer."""

    request: tuple[int, int]
    record: Record
    answer: Callable[[BeginReply], None]
    now: Inspection


class Station:
    """One process of the station, from its start to its kill."""

    def __init__(self, cell: Cell, boot: int) -> None:
        self.cell, self.boot, self.alive = cell, boot, True
        self._clock, self._records = cell.clock, cell.records
        self.alarms = AlarmManager(cast("Any", NoMetrics()))
        self._outcomes = OutcomeMonitor(self.alarms)
        self._hold = cell.hold
        self.cycle = Cycle(cell.hold)
        self._doing: dict[Action, Timer] = {}
        self._queue: deque[Event] = deque()
        self._busy = False
        self._entered_s = self._clock.s
        self._records_fault: RecordsError | None = None
        self._pending: Pending | None = None
        self._now: Inspection | None = None
        self._begun: list[Inspection] = []
        self._last: tuple[tuple[int, int], Inspection] | None = None
        self._waiting: dict[int, list[Callable[[Outcome], None]]] = {}
        self._goes_on: Callable[[], None] | None = None
        self._late: Timer | None = None
        self._seen_faults: set[str] = set()
        self._records.end_open(self._utc_ms())
        self._act(self.cycle.begin.actions, cell.hold or Event.RESET)
        self._entered(self.cycle.state)
        self._monitor()

    @property
    def state(self) -> State:
        """Where the cycle is."""
        return self.cycle.state

    def kill(self) -> None:
        """End the process: what it does not have on the disk is lost, and the devices stop."""
        self.alive = False

    # Requests of the PLC interface.

    def report(self) -> StationState:
        """Answer a beat."""
        alarms = self.alarms.alarms
        return StationState(
            boot=f"boot {self.boot}",
            healthy=True,
            ready=STATES[self.state].refusal is None,
            why_not_ready=None,
            packml_state=STATES[self.state].packml,
            mode=1,
            recipe_number=_NUMBER[0],
            recipe_checksum=_NUMBER[1],
            error_code=alarms.error_code,
            alarms=alarms.word,
            simulated=True,
        )

    def begin(self, trigger_id: int, encoder: int, lot: str, answer: Callable[[BeginReply], None]) -> None:
        """Begin an inspection or refuse it; the same request again begins none."""
        request = trigger_id, encoder
        if self._last is not None and self._last[0] == request:
            answer(self._accepted(self._last[1]))
        elif (refusal := STATES[self.state].refusal) is not None or self._pending is not None:
            answer(BeginReply(refusal=refusal or Refusal.BUSY))
        else:
            record = Record(trigger_id, encoder, lot, _NUMBER, self._utc_ms())
            self._pending = Pending(request, record, answer, Inspection())
            self.post(Event.TRIGGER)

    def await_outcome(self, sequence: int, answer: Callable[[Outcome], None]) -> bool:
        """Answer once there is an outcome; False where the inspection is unknown."""
        record = self._records.get(sequence)
        if record is None:
            return False
        known = any(now.sequence == sequence and not now.standing for now in self._begun)
        if record.standing is not None and not known:
            answer(record.standing)
        else:
            self._waiting.setdefault(sequence, []).append(answer)
        return True

    def published(self, outcome: Outcome) -> bool:
        """Note what the PLC was given; False where the disk refuses."""
        if self.cell.devices.trouble("disk") == "full":
            return False
        if self._records.publish(outcome):
            self._outcomes.add(outcome)
        if self._last is not None and self._last[1].sequence == outcome.sequence:
            self._last = None
        self._tell(outcome)
        if (running := self._running) is not None and running.sequence == outcome.sequence and self.state in UNJUDGED:
            self.post(Event.CALLED_OFF)
        return True

    def acknowledged(self, sequence: int) -> bool:
        """Note what the PLC has taken; False where the disk refuses."""
        if self.cell.devices.trouble("disk") == "full":
            return False
        self._records.acknowledge(sequence)
        return True

    def open(self) -> Any:
        """Return what began and was not acknowledged."""
        running = self._running
        return self._records.open(
            None if running is None else (running.sequence, self._records[running.sequence].trigger_id)
        )

    # The cycle.

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
                self.alarms.raise_(act.alarm, _WORDS)
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
        """Ask the part that an action needs."""
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

    # What the actions end with.

    def _open_jaws(self) -> Event:
        return Event.JAWS_OPEN

    _free_fruit = _open_jaws

    def _go_home(self) -> Event:
        return Event.HOME

    def _check_jaws(self) -> Event:
        if self.cell.jaws_open:
            return Event.JAWS_OPEN
        self._interrupt(Reason.REFERENCE_BAD)
        return Event.REFERENCE_BAD

    def _approach(self) -> Event:
        _, fault = self.cell.devices.request("camera", 0.01)
        if fault is not None:
            return event_of(fault)
        if self.cell.devices.trouble("camera") in {"garbage", "wrong"} and self.cell.rng.random() < 0.5:
            self._interrupt(Reason.REFERENCE_BAD)
            self.alarms.raise_(AlarmId.REFERENCE_BAD, _WORDS)
            return Event.REFERENCE_BAD
        self.alarms.clear(AlarmId.REFERENCE_BAD)
        return Event.ARRIVED

    def _close_to_onset(self) -> Event:
        now, fruit = self._inspection, self.cell.fruit
        if fruit is None or not fruit.mm2_per_mm:
            self._interrupt(Reason.NO_CONTACT)
            return Event.NO_ONSET
        now.closings += 1
        if fruit.off_middle and now.closings == 1:
            return Event.OFF_MIDDLE
        now.onset_mm = fruit.width_mm + (9.0 if self.cell.devices.trouble("gripper") == "wrong" else 0.0)
        self._see(0.0)
        now.seen = 1
        return Event.ONSET_FOUND

    def _centre(self) -> Event:
        return Event.CENTRED

    def _close_step(self) -> Event:
        self._inspection.closed_steps += 1
        return Event.REACHED

    def _settle(self) -> Event:
        return Event.SETTLED

    def _capture(self) -> Event:
        now = self._inspection
        wrong_mm = 1.2 if self.cell.devices.trouble("gripper") == "wrong" else 0.0
        self._see(max(0.1, now.closed_steps * RECIPE.steps.step_mm - wrong_mm))
        return Event.LAST_CAPTURED if now.closed_steps >= RECIPE.steps.number else Event.CAPTURED

    def _see(self, closing_mm: float) -> None:
        now, fruit = self._inspection, self.cell.fruit
        now.captured.append(point(fruit, closing_mm, self.cell.devices.trouble("camera"), self.cell.rng))
        now.fruits.add(0 if fruit is None else fruit.number)

    def _measure(self) -> Event:
        now = self._inspection
        now.seen += 1
        if ends_steps(now.press()):
            return Event.EARLY_STOP
        if self._goes_on is not None:
            goes_on, self._goes_on = self._goes_on, None
            goes_on()
        return Event.MEASURED

    def _judge(self) -> Event:
        now = self._inspection
        now.verdict = judged(now.press())
        if len(now.earlier) + 1 < RECIPE.press.attempts and needs_second_press(now.verdict):
            now.earlier.append(now.press())
            now.let_go()
            return Event.PRESS_AGAIN
        now.outcome = now.verdict.outcome
        return Event.JUDGED_ACCEPT if now.outcome == "PASS" else Event.JUDGED_REJECT

    def _place_accept(self) -> Event:
        return Event.PLACED

    _place_reject = _place_accept

    def _recover_arm(self) -> Event:
        return Event.RECOVERED

    def _record_trigger(self) -> Event | None:
        pending = self._pending
        if pending is None:
            return None
        pending.now.sequence = self._records.begin(pending.record)
        return Event.TRIGGER_RECORDED

    def _record(self) -> Event:
        self._conclude(self._inspection)
        return Event.RECORDED

    def _close_unfinished(self) -> Event:
        while (now := self._running) is not None:
            now.outcome = "NO_RESULT"
            if not now.interruptions:
                now.interruptions.append(Reason.RECORDS_FAULT)
            self._conclude(now)
            self._deliver(now)
        return Event.UNFINISHED_CLOSED

    # Small parts.

    @property
    def _inspection(self) -> Inspection:
        if self._now is None:
            raise RuntimeError("no inspection is under way")
        return self._now

    @property
    def _running(self) -> Inspection | None:
        return next((now for now in self._begun if not now.standing), None)

    def _interrupt(self, reason: Reason) -> None:
        now = self._inspection
        if reason not in now.interruptions:
            now.interruptions.append(reason)
        now.outcome = "NO_RESULT"

    def _conclude(self, now: Inspection) -> None:
        record, press = self._records[now.sequence], now.press()
        verdict = now.verdict or judged(press)
        reasons = () if now.outcome == "PASS" else (now.interruptions or verdict.reasons or (Reason.INTERNAL_FAULT,))
        outcome = record.outcome(now.sequence, now.outcome, reasons, self._utc_ms())
        if (deciding := verdict.deciding) is not None:
            found = {"area_mm2": deciding.area_mm2, "area_px": deciding.area_px, "closing_mm": deciding.closing_mm}
            outcome = outcome.model_copy(update=found)
        record.press, record.fruits = press, now.fruits
        self._records.conclude(now.sequence, outcome)
        now.standing = True

    def _deliver(self, now: Inspection) -> None:
        standing = self._records[now.sequence].standing
        if now.standing and standing is not None:
            self._tell(standing)

    def _tell(self, outcome: Outcome) -> None:
        for answer in self._waiting.pop(outcome.sequence, ()):
            answer(outcome)

    def _accept(self) -> None:
        pending, self._pending = self._pending, None
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        self._now = pending.now
        self._take_on(pending)
        self._watch()

    def _take_on(self, pending: Pending) -> None:
        pending.now.accepted_s = self._clock.s
        self._begun = [now for now in self._begun if not now.standing]
        self._begun.append(pending.now)
        self._last = pending.request, pending.now
        pending.answer(self._accepted(pending.now))

    @staticmethod
    def _accepted(now: Inspection) -> BeginReply:
        return BeginReply(sequence=now.sequence, deadline_s=LIMITS.inspection_s + RECORD_NO_RESULT_S)

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

    # The devices' monitors, and housekeeping.

    def _monitor(self) -> None:
        """See what the devices' monitors see, and report a change."""
        for part in ("arm", "gripper", "camera"):
            fault = self.cell.devices.standing(part)
            news = fault is not None and part not in self._seen_faults
            (self._seen_faults.add if fault is not None else self._seen_faults.discard)(part)
            self.alarms.set_device_fault(part, fault)
            if news and fault is not None:
                self.post(event_of(fault))
        full = self.cell.devices.trouble("disk") == "full"
        self.alarms.update(AlarmId.RECORDS_NOT_WRITABLE, None if self._records_fault is None else _WORDS)
        self.alarms.update(AlarmId.DISK_LOW, _WORDS if full else None)
        jumps = self.cell.devices.trouble("clock")
        self.alarms.update(AlarmId.CLOCK_STEPPED, None if jumps is None else _WORDS)
        self.alarms.tick()
        self._after(_MONITOR_S, self._monitor)

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

    def _check(self, asked_in: State) -> None:
        if self.state is not asked_in:
            return
        for part in ("arm", "gripper", "camera"):
            if (fault := self.cell.devices.standing(part)) is not None:
                self.post(event_of(fault))
                return
        self.post(Event.RECORDS_FAULT if self._records_fault is not None else Event.READY)

    def _after(self, delay_s: float, what: Callable[[], None]) -> Timer:
        return self._clock.after(delay_s, lambda: what() if self.alive else None)

    def _utc_ms(self) -> int:
        return round(1000 * self._clock.time())
