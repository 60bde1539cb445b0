"""Inspection service: carries out the cycle's actions, and answers requests for inspections."""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from functools import partial

from station.channel.line import Begin, BeginReply, Outcome
from station.clock import utc_ms
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import ACCEPTING, PLACING, REASONS, UNJUDGED, Action, Event, Raise
from station.inspection.states import STATES, State
from station.messages import operation as messages
from station.messages.message import Message, message_of
from station.records.errors import RecordsError
from station.records.model import Trigger
from station.records.records import Records
from station.runtime.alarms.manager import AlarmManager
from station.runtime.alarms.outcome_monitor import OutcomeMonitor
from station.runtime.cycle.actions import Inspector
from station.runtime.cycle.hold import Hold
from station.runtime.cycle.inspection import Inspection
from station.runtime.cycle.pacing import RECORD_NO_RESULT_S, Pacing, late_now
from station.runtime.cycle.recent_triggers import PendingTrigger, RecentTriggers
from station.runtime.cycle.registry import InspectionRegistry
from station.runtime.cycle.runner import CycleRunner, Happened, Work, event_of
from station.runtime.devices.manager import DeviceManager
from station.runtime.observability.observability import Observability
from station.runtime.recipes.active import ActiveRecipe
from station.settings.configuration import Configuration
from station.state_files import StateFiles
from station.vocabulary import Refusal

CYCLE = "cycle"


class Service:
    """Performer of the cycle, and server of the line's requests."""

    def __init__(
        self,
        configuration: Configuration,
        records: Records,
        devices: DeviceManager,
        inspector: Inspector,
        alarms: AlarmManager,
        observability: Observability,
    ) -> None:
        self._settings = configuration.service
        self._resolution_mm = configuration.gripper.calibration.mm_per_count
        self._devices, self._inspector = devices, inspector
        self.alarms, self._metrics, self._liveness = alarms, observability.metrics, observability.liveness
        self._carries = self._settings.placing == "arm" and not self._settings.bench
        self._hold = Hold(StateFiles(configuration.home), carries=self._carries)
        alarms.keep_pendant_alarm(lambda: self._hold.event is Event.PROGRAM_STOPPED)
        self.runner = CycleRunner(self, self._hold.event)
        self.triggers = RecentTriggers()
        self.registry = InspectionRegistry(records, self.triggers, devices, observability.versions)
        self.pacing = Pacing(configuration, devices.cell)
        self.active: ActiveRecipe | None = None
        """The recipe that the next fruit is inspected with."""
        self._automatic_reset = self._settings.automatic_reset and self._hold.event is None
        self._reset_given = False
        """By a person or the PLC, and not carried out yet."""
        self._confirmed_before = self._hold.event is None
        """The process before left no hold: a stop whose alarm is still latched was confirmed by a person."""
        self._in_production = True
        self.manual_activity: Message | None = None
        """The activity at the panel that moves something by hand, in manual mode alone; None without one."""
        self._end_manual: Callable[[], Awaitable[None]] | None = None
        self.ending = False
        """The end of the process was requested."""
        self.stopped_by_person = False
        """A person has stopped the station, until the next reset."""
        self._on_published: Callable[[Outcome], None] = lambda _: None
        self._pending: PendingTrigger | None = None
        self._now: Inspection | None = None
        self._beginning = asyncio.Lock()
        self._background: set[asyncio.Task[None]] = set()
        self._late_in: State | None = None
        self._outcomes = OutcomeMonitor(alarms)
        self._at_once: Mapping[Action, Callable[[Happened], None]] = {
            Action.ACCEPT_TRIGGER: lambda _: self._accept(),
            Action.REFUSE_TRIGGER: self._refuse,
            Action.CLOSE_AS_NO_RESULT: self._close_as_no_result,
            Action.PUBLISH: lambda _: self._publish(),
            # The monitors read for ever, and housekeeping posts the event once all devices are healthy.
            Action.READ_DEVICES: lambda _: None,
        }
        """Actions that take no time."""
        self._of_station: Mapping[Action, Work] = {
            Action.OPEN_JAWS: inspector.open_jaws,
            Action.GO_HOME: inspector.go_home,
            Action.CHECK_DEVICES: self._check,
            Action.CLOSE_UNFINISHED: self.registry.close_unfinished,
            Action.RECOVER_ARM: self._recover_arm,
            Action.RECORD_TRIGGER: self._record_trigger,
        }
        """Actions with or without an inspection."""
        self._of_inspection: Mapping[Action, Callable[[Inspection], Awaitable[Event | None]]] = {
            Action.FREE_FRUIT: inspector.free_fruit,
            Action.CHECK_JAWS: inspector.check_jaws,
            Action.APPROACH: inspector.approach,
            Action.CLOSE_TO_ONSET: inspector.close_to_onset,
            Action.CENTRE: inspector.centre,
            Action.CLOSE_STEP: inspector.close_step,
            Action.SETTLE: inspector.settle,
            Action.CAPTURE: inspector.capture,
            Action.MEASURE: inspector.measure,
            Action.JUDGE: inspector.judge,
            Action.RECORD: self.registry.conclude,
            Action.PLACE_ACCEPT: inspector.place,
            Action.PLACE_REJECT: inspector.place,
        }
        """Actions of the inspection under way."""

    @property
    def state(self) -> State:
        """Return the cycle's state."""
        return self.runner.state

    def set_active(self, active: ActiveRecipe | None) -> None:
        """Inspect the next fruit with another recipe; without one no trigger is accepted."""
        self.active = active

    def end(self) -> None:
        """Accept no trigger any more: the process is about to end."""
        self.ending = True

    @property
    def makes_itself_ready(self) -> bool:
        """Return whether anything may move between fruits without a person's or the PLC's reset."""
        automatic = self._automatic_reset and self._in_production
        return (automatic or self._reset_given) and not (self.ending or self.stopped_by_person)

    def stop(self) -> None:
        """Accept no trigger until `allow`: a person has stopped the station."""
        self.stopped_by_person = True
        self.runner.check_again()

    def allow(self) -> None:
        """End a person's stop."""
        self.stopped_by_person = False
        self.runner.check_again()

    def request_reset(self) -> None:
        """Let a stopped station make itself ready."""
        self._reset_given = True

    def withdraw_reset(self) -> None:
        """Let a stopped station make itself ready no more by a reset that was given."""
        self._reset_given = False

    def set_mode(self, *, production: bool) -> None:
        """Reset automatically in production mode only: in another, people may reach into the cell.

        A reset that was given before is withdrawn there.
        """
        self._in_production = production
        if not production:
            self.withdraw_reset()

    @contextlib.contextmanager
    def manual(self, activity: Message, end: Callable[[], Awaitable[None]]) -> Iterator[None]:
        """Keep mode and devices to an activity at the panel that moves something; a refused person reads which.

        Args:
            end: ends the activity at a person's stop; it returns once nothing moves by it.
        """
        self.manual_activity, self._end_manual = activity, end
        try:
            yield
        finally:
            self.manual_activity = self._end_manual = None

    async def end_manual(self) -> None:
        """End the activity at the panel that moves something by hand, if there is one."""
        if self._end_manual is not None:
            await self._end_manual()

    def listen(self, on_published: Callable[[Outcome], None]) -> None:
        """Call a function, in place of the one before, once with every outcome that the PLC was given."""
        self._on_published = on_published

    # Requests of the line.

    async def begin(self, request: Begin, refusal: Refusal | None, lot: str) -> BeginReply:
        """Begin an inspection of a lot's fruit, or refuse it with the refusal given.

        The PLC interface sends each trigger once, so an equal request is another fruit's: the PLC may use the id of a
        refused trigger again, and its interface may not have received the answer to that one.
        """
        async with self._beginning:
            if refusal is not None or self.active is None:
                return self._refused(refusal or Refusal.NOT_READY)
            trigger = Trigger(
                request.trigger_id,
                request.encoder,
                lot,
                utc_ms(),
                self.active.snapshot,
                self._devices.simulated,
                request.fruit_length_mm_x10,
                request.size_class,
            )
            limits = self.pacing.limits(self.active.recipe)
            scale = self._devices.calibration.in_force
            now = Inspection(
                trigger,
                self.active,
                limits,
                scale.mm_per_px,
                str(scale.words),
                scale.scale_uncertainty,
                self._resolution_mm,
            )
            self._pending = PendingTrigger(now)
            self.runner.post(Event.TRIGGER)
            return await self._pending.answered()

    async def published(self, outcome: Outcome) -> None:
        """Store that the PLC was given a final outcome, and count it, once; cancel a fruit still under inspection."""
        now = self.triggers.inspection(outcome.sequence)
        # Before the disk has it: a fruit that is placed meanwhile goes where the PLC's outcome sends it.
        if now is not None:
            now.published = outcome
        first = await self.registry.records.published(outcome)
        self.triggers.ended(outcome)
        if first:
            fruit = "" if now is None else now.active.recipe.name
            known = (None, None) if now is None else (now.phases_s, now.limits.inspection_s)
            self._metrics.inspection(fruit, outcome, *known)
            self._outcomes.add(outcome)
            self._on_published(outcome)
        self.abort(outcome.sequence, messages.ANOTHER_OUTCOME())

    def abort(self, sequence: int, why: Message) -> None:
        """End an inspection with NO_RESULT, if it is under way and not judged yet."""
        running = self.registry.running
        if running is not None and running.sequence == sequence and self.state in UNJUDGED:
            self.runner.post(Event.CALLED_OFF, why)

    # Actions of the cycle: see `Performer`.

    def perform(self, action: Action, because: Happened) -> Work | None:
        """Carry out an action of the cycle."""
        if action in self._at_once:
            self._at_once[action](because)
            return None
        if action in self._of_station:
            return self._of_station[action]
        return partial(self._of_inspection[action], self._inspection)

    async def halt(self) -> None:
        """Stop the devices where they are."""
        await self._devices.halt()

    def storing(self, event: Event, state: State) -> Awaitable[None] | None:
        """Return the write of the hold that a state begins or ends; None without one."""
        return self._hold.store() if self._hold.changes(event, state) else None

    def raise_alarm(self, alarm: Raise, why: Message | None) -> None:
        """Raise an alarm of the cycle."""
        self.alarms.raise_(alarm.alarm, why)

    def failed(self, fault: StationError) -> None:
        """Report a fault to the device's monitor before the cycle reads the devices' state."""
        self._devices.report_fault(fault)

    def refused(self, state: State, event: Event) -> None:
        """Count an event that the table does not list; a trigger among them is answered."""
        self._metrics.unexpected()
        if event is Event.TRIGGER and self._pending is not None and not self._pending.is_answered:
            self._pending.answer(self._refused(STATES[state].refusal or Refusal.NOT_READY))

    def entered(self, state: State, after: State, took_s: float) -> None:
        """Store the phase's time, and do what depends on the new state."""
        self._late_in = None
        if self._now is not None and STATES[after].refusal is Refusal.BUSY and after not in ACCEPTING:
            self._now.phases_s[after.value] = self._now.phases_s.get(after.value, 0.0) + took_s
        inspecting_now = STATES[state].refusal is Refusal.BUSY and state not in ACCEPTING
        if self.manual_activity is None:  # else they are that activity's
            self._devices.use(by_inspection=inspecting_now)
        if STATES[state].needs_person:
            self._automatic_reset = self._reset_given = False
        if state is State.IDLE:
            self.alarms.clear(AlarmId.FRUIT_HELD)
            if self._reset_given or self._confirmed_before:
                self.alarms.reset()
                self._confirmed_before = False
            self._automatic_reset, self._reset_given = self._settings.automatic_reset, False
        if state is State.STOPPED and self.makes_itself_ready:
            self.runner.post(Event.RESET)

    def tick(self) -> None:
        """Feed the watchdogs, and give the cycle the events of elapsed time."""
        self._liveness.progress(CYCLE)
        if not self._liveness.stuck():
            self._devices.renew_health()
        self._report_late()
        # A HALT would stop what an activity at the panel still moves: its jaws that open, and the arm that leaves.
        moves_by_hand = self.manual_activity is not None
        if self.ending and not moves_by_hand and self.state in {State.IDLE, *UNJUDGED} and self._late_in is None:
            self._late_in = self.state
            self.runner.post(Event.STOP, messages.STATION_ENDS())

    def device_changed(self, fault: StationError | None) -> None:
        """Handle a monitor's report that a device has another fault from now on, or none."""
        if fault is None:
            return
        event = event_of(fault)
        if event is Event.INTERNAL_FAULT:  # a bug in the arm's check: in the table the event is that of an action
            event = Event.ARM_FAULT
        if event is Event.ARM_FAULT and self.state in PLACING and not self._carries:
            return  # the jaws let the fruit go where the arm stands; its way home meets the fault
        self.runner.post(event, message_of(fault))

    # The actions.

    async def _check(self) -> Event:
        if self.ending or self.stopped_by_person:
            return Event.STOP
        for fault in (*self._devices.faults.values(), self.registry.fault):
            if fault is not None:
                raise fault.again()
        return Event.READY

    async def _recover_arm(self) -> Event:
        await self._devices.restart_program()
        return Event.RECOVERED

    async def _record_trigger(self) -> Event | None:
        pending = self._pending
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        try:
            await self.registry.begin(pending)
        except RecordsError:
            pending.answer(self._refused(Refusal.RECORDS_FULL))
            raise
        return Event.TRIGGER_RECORDED

    def _accept(self) -> None:
        pending, self._pending = self._pending, None
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        self._now = pending.inspection
        self._take_on(pending)

    def _close_as_no_result(self, because: Happened) -> None:
        self._inspector.close_as_no_result(self._inspection, because.event, because.why)

    def _publish(self) -> None:
        self.registry.deliver(self._inspection)

    def _refuse(self, because: Happened) -> None:
        """End a trigger without an inspection: refused if it is not durable yet, else accepted and closed."""
        pending, self._pending = self._pending, None
        if pending is None:
            return
        now = pending.inspection
        if now.sequence is None:
            if pending.recording is not None:
                pending.recording.cancel()  # which takes the record back
            if not pending.is_answered:
                pending.answer(self._refused(STATES[self.state].refusal or Refusal.NOT_READY))
            return
        self._take_on(pending)
        now.interrupt(REASONS[because.event], because.why)
        closing = asyncio.create_task(self._close_refused(), name="closing a refused trigger")
        self._background.add(closing)
        closing.add_done_callback(self._background.discard)

    def _take_on(self, pending: PendingTrigger) -> None:
        now = pending.inspection
        now.accepted_s = time.monotonic()
        try:
            # Known before the answer: the request for its outcome follows at once.
            self.triggers.accepted(now)
            self.registry.accepted(now)
            reply = BeginReply(sequence=now.sequence, deadline_s=now.limits.inspection_s + RECORD_NO_RESULT_S)
        except Exception as error:
            pending.fail(error)
            raise
        pending.answer(reply)

    # Small parts.

    @property
    def _inspection(self) -> Inspection:
        """The inspection under way, or the last one."""
        if self._now is None:
            raise RuntimeError("there is no inspection")
        return self._now

    def _refused(self, refusal: Refusal) -> BeginReply:
        self._metrics.refused(refusal)
        return BeginReply(refusal=refusal)

    def _report_late(self) -> None:
        if self._now is None or self._late_in is self.state:
            return
        found = late_now(self._now, self.state, self.runner.in_state_s)
        if found is not None:
            self._late_in = self.state
            took = {"took_s": found.took_s, "limit_s": found.allowed_s}
            if found.event is Event.LATE:
                why = messages.INSPECTION_LATE(**took)
            else:
                why = messages.PHASE_LATE(**took, activity=STATES[self.state].activity)
            self.runner.post(found.event, why)

    async def _close_refused(self) -> None:
        with contextlib.suppress(RecordsError):  # the registry still has it, and the next clearing tries again
            await self.registry.close_unfinished()
