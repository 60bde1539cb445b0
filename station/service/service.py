"""The station's service: carries the cycle's actions out, and answers whoever asks for inspections."""

import asyncio
import logging
import time
from collections import deque
from collections.abc import Awaitable, Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations

from station.channel.line import Begin, Begun, Open, Outcome
from station.devices.arm.ur import POSES
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import REASONS, UNJUDGED, Action, Event, Raise
from station.inspection.deadlines import LONGEST_S, Deadlines, Pace, deadlines, late
from station.inspection.states import STATES, State
from station.records.errors import RecordsError
from station.records.model import InspectionRecord, Trigger
from station.records.records import Records
from station.service.alarm_desk import AlarmDesk
from station.service.conductor import Conductor, Happened, Work, event_of
from station.service.crew import Crew
from station.service.health import Liveness
from station.service.inspection import Inspection, utc_ms
from station.service.inspector import Inspector
from station.service.logs import fruit_line, inspecting
from station.service.metrics import Metrics
from station.service.recipe_book import Active
from station.service.triggers import Pending, Triggers
from station.settings.arm import ArmSettings
from station.settings.configuration import Configuration
from station.vocabulary import OutcomeName, Reason, Refusal

log = logging.getLogger(__name__)

CYCLE = "cycle"
_LEASE_S = 2.0
_LAST_OUTCOMES = 20
_MANY = 5
_MEASURE_S = 0.3
_FRAMES_PER_S = 30.0
_RECORD_NO_RESULT_S = 1.0


class Service:
    """The cycle's performer, and the line's side of it.

    Args:
        configuration: the site's.
        records: opened.
        crew: the devices; told of inspections.
        inspector: carries out what needs the devices.
        alarms: the desk.
        metrics: counts.
        liveness: fed with the cycle's progress.
        versions: of the programs, for the records.
    """

    def __init__(
        self,
        configuration: Configuration,
        records: Records,
        crew: Crew,
        inspector: Inspector,
        alarms: AlarmDesk,
        metrics: Metrics,
        liveness: Liveness,
        versions: Mapping[str, str],
    ) -> None:
        self._settings, self._configuration = configuration.service, configuration
        self.records, self._crew, self._inspector = records, crew, inspector
        self.alarms, self._metrics, self._liveness = alarms, metrics, liveness
        self._versions = versions
        self.conductor = Conductor(self)
        self.triggers = Triggers()
        self.active: Active | None = None
        """The recipe that the next fruit is inspected with."""
        self.reset_wanted = self._settings.automatic_reset
        """Whether a stopped station makes itself ready."""
        self.stop_asked = False
        self._pending: Pending | None = None
        self._now: Inspection | None = None
        self._unrecorded: list[Inspection] = []
        self.records_fault: RecordsError | None = None
        """Why the records are not to be relied on, until they were opened again."""
        self._beginning, self._closing = asyncio.Lock(), asyncio.Lock()
        self._background: set[asyncio.Future[Event | None]] = set()
        self._told_late: State | None = None
        self._last_outcomes: deque[OutcomeName] = deque(maxlen=_LAST_OUTCOMES)

    @property
    def state(self) -> State:
        """Where the cycle is."""
        return self.conductor.state

    @property
    def running(self) -> Inspection | None:
        """The inspection without a durable outcome, if there is one."""
        unfinished = [now for now in (self._now, *self._unrecorded) if now is not None and now.standing is None]
        return unfinished[0] if unfinished else None

    # What the line asks.

    async def begin(self, request: Begin, refusal: Refusal | None) -> Begun:
        """Begin an inspection, or say why not. The same request again, before its outcome was told, begins none.

        Args:
            request: the trigger.
            refusal: why none may begin now.
        """
        async with self._beginning:
            if (same := self.triggers.repeated(request)) is not None:
                return self._begun(same)
            if refusal is not None or self.active is None:
                return self._refused(refusal or Refusal.NOT_READY)
            trigger = Trigger(
                request.trigger_id,
                request.encoder,
                request.lot,
                utc_ms(),
                self.active.snapshot,
                self._crew.simulated,
            )
            now = Inspection(trigger, self.active, self._limits(self.active), self._configuration.camera.mm_per_px)
            self._pending = Pending(request, now)
            self.conductor.post(Event.TRIGGER)
            return await self._pending.answered()

    async def outcome(self, sequence: int) -> Outcome:
        """Wait for an inspection's outcome; of an earlier start of the station it is there at once.

        Args:
            sequence: its number.
        """
        if self.triggers.inspection(sequence) is None:
            for outcome in (await self.records.open_inspections()).ended:
                if outcome.sequence == sequence:
                    return outcome
        return await self.triggers.outcome(sequence)

    async def published(self, outcome: Outcome) -> None:
        """Note durably what the PLC was told, and count it, once; a fruit that is still inspected is called off by it.

        Args:
            outcome: what stands from now on.
        """
        first = await self.records.published(outcome)
        self.triggers.published(outcome)
        if first:
            now = self.triggers.inspection(outcome.sequence)
            fruit = "" if now is None else now.active.recipe.name
            self._metrics.inspection(fruit, outcome, None if now is None else now.phases_s)
            self._watch_outcomes(outcome)
        if self.running is not None and self.running.sequence == outcome.sequence and self.state in UNJUDGED:
            self.conductor.post(Event.CALLED_OFF, "the PLC was given another outcome for this fruit meanwhile")

    async def open(self) -> Open:
        """What was begun and not acknowledged."""
        held = await self.records.open_inspections()
        now = self.running
        running = None if now is None or now.sequence is None else (now.sequence, now.trigger.trigger_id)
        return Open(running=running, outcomes=held.ended)

    # What the cycle asks: see `Performer`.

    def perform(self, action: Action, because: Happened) -> Work | None:  # noqa: C901, PLR0911, PLR0912
        """Carry an action of the cycle out."""
        match action:
            case Action.OPEN_JAWS:
                return self._inspector.open_jaws
            case Action.GO_HOME:
                return self._inspector.go_home
            case Action.CHECK_DEVICES:
                return self._check
            case Action.CLOSE_UNFINISHED:
                return self._close_unfinished
            case Action.RECOVER_ARM:
                return self._recover_arm
            case Action.RECORD_TRIGGER:
                return self._record_trigger
            case Action.ACCEPT_TRIGGER:
                self._accept()
                return None
            case Action.REFUSE_TRIGGER:
                self._refuse(because)
                return None
            case Action.READ_DEVICES:  # the watches read for ever, and `tick` tells when all are well
                return None
            case _:
                pass
        now = self._now
        if now is None:
            raise RuntimeError(f"{action} without an inspection")
        match action:
            case Action.CLOSE_AS_NO_RESULT:
                self._inspector.close_as_no_result(now, because.event, because.why)
                return None
            case Action.RECORD:
                return partial(self._record, now)
            case Action.PUBLISH:
                self._publish(now)
                return None
            case Action.PLACE_ACCEPT | Action.PLACE_REJECT:
                return partial(self._inspector.place, now)
            case _:
                return partial(getattr(self._inspector, action.value), now)

    async def halt(self) -> None:
        """Stop the devices where they are."""
        await self._crew.halt()

    def raise_alarm(self, told: Raise, why: str) -> None:
        """Raise an alarm of the cycle's."""
        self.alarms.raise_(told.alarm, why)

    def failed(self, fault: StationError) -> None:
        """Let the device's watch know before the cycle asks how the devices do."""
        self._crew.failed(fault)

    def refused(self, state: State, event: Event) -> None:
        """Count what the table does not list; a trigger among it is answered."""
        self._metrics.unexpected()
        if event is Event.TRIGGER and self._pending is not None and not self._pending.is_answered:
            self._pending.answer(self._refused(STATES[state].refusal or Refusal.NOT_READY))

    def entered(self, state: State, after: State, took_s: float) -> None:
        """Keep the phases' times, and what hangs on a state."""
        self._told_late = None
        if self._now is not None and STATES[after].refusal is Refusal.BUSY and after is not State.ACCEPTING:
            self._now.phases_s[after.value] = self._now.phases_s.get(after.value, 0.0) + took_s
        inspecting_now = STATES[state].refusal is Refusal.BUSY and state is not State.ACCEPTING
        self._crew.use(by_inspection=inspecting_now)
        if state in {State.LATCHED, State.CARRIED}:
            self.reset_wanted = False
        if state is State.IDLE:
            self.reset_wanted = self._settings.automatic_reset
            self.alarms.clear(AlarmId.FRUIT_HELD)
        if state is State.STOPPED and self.reset_wanted and not self.stop_asked:
            self.conductor.post(Event.RESET)

    def tick(self) -> None:
        """Feed the watchdogs, and tell the cycle what time alone brings."""
        self._liveness.progress(CYCLE)
        if not self._liveness.stuck():
            self._crew.renew_health(_LEASE_S)
        self._tell_late()
        if self.stop_asked and self.state in {State.IDLE, *UNJUDGED} and self._told_late is None:
            self._told_late = self.state
            self.conductor.post(Event.STOP, "the station is told to end")

    def device_changed(self, fault: StationError | None) -> None:
        """A watch has found a device to be otherwise than before.

        Args:
            fault: what is wrong from now on, None for nothing.
        """
        if fault is not None:
            self.conductor.post(event_of(fault), str(fault))

    # The actions.

    async def _check(self) -> Event:
        if self.stop_asked:
            return Event.STOP
        for fault in (*self._crew.faults.values(), self.records_fault):
            if fault is not None:
                raise fault
        return Event.READY

    async def _recover_arm(self) -> Event:
        await self._crew.play_again()
        return Event.RECOVERED

    async def _record_trigger(self) -> Event | None:
        pending = self._pending
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        pending.recording = asyncio.ensure_future(self.records.begin(pending.inspection.trigger))
        try:
            pending.inspection.sequence = await pending.recording
        except RecordsError as error:
            self.records_fault = error
            pending.answer(self._refused(Refusal.RECORDS_FULL))
            raise
        return Event.TRIGGER_RECORDED

    def _accept(self) -> None:
        pending, self._pending = self._pending, None
        if pending is None:
            raise RuntimeError("no trigger is waiting")
        self._now = now = pending.inspection
        now.accepted_s = time.monotonic()
        self.triggers.accepted(pending.request, now)
        pending.answer(self._begun(now))

    def _refuse(self, because: Happened) -> None:
        """Nothing comes of the trigger: refused where it is not durable yet, else accepted and closed."""
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
        now.accepted_s = time.monotonic()
        self.triggers.accepted(pending.request, now)
        pending.answer(self._begun(now))
        now.interrupt(REASONS[because.event], because.why)
        self._unrecorded.append(now)
        self._in_background(self._close_unfinished())

    async def _record(self, now: Inspection) -> Event:
        if now.sequence is None:
            raise RuntimeError("an inspection without a sequence is recorded")
        try:
            now.standing = await self.records.conclude(now.sequence, self._signed(now.record()))
        except RecordsError as error:
            self.records_fault = error
            raise
        return Event.RECORDED

    def _publish(self, now: Inspection) -> None:
        if now.standing is not None:
            self.triggers.ended(now.standing)
            areas = [seen.contact.area_px * now.mm_per_px**2 for seen in now.seen]
            with inspecting(now.standing.sequence):
                log.info(fruit_line(now.standing, now.active.recipe.name, now.record().explanation, areas))

    async def _close_unfinished(self) -> Event:
        async with self._closing:
            while (now := self.running) is not None:
                now.outcome_name = "NO_RESULT"
                if not now.interruptions:
                    now.interrupt(Reason.RECORDS_FAULT, "the outcome could not be made durable in time")
                await self._record(now)
                self._publish(now)
            self._unrecorded.clear()
        return Event.UNFINISHED_CLOSED

    # Small parts.

    def _begun(self, now: Inspection) -> Begun:
        left_s = now.limits.inspection_s + _RECORD_NO_RESULT_S
        if now.accepted_s is not None:
            left_s -= time.monotonic() - now.accepted_s
        return Begun(sequence=now.sequence, deadline_s=max(0.0, left_s))

    def _refused(self, refusal: Refusal) -> Begun:
        self._metrics.refused(refusal)
        return Begun(refusal=refusal)

    def _watch_outcomes(self, outcome: Outcome) -> None:
        self._last_outcomes.append(outcome.outcome)
        last = list(self._last_outcomes)
        unjudged = last[-_MANY:] == ["NO_RESULT"] * _MANY
        self.alarms.show(AlarmId.MANY_NO_RESULT, f"the last {_MANY} fruit could not be judged" if unjudged else "")
        failed = len(last) == _LAST_OUTCOMES and last.count("FAIL") > _LAST_OUTCOMES / 2
        told = f"{last.count('FAIL')} of the last {_LAST_OUTCOMES} fruit failed" if failed else ""
        self.alarms.show(AlarmId.REJECT_RATE, told)

    def _limits(self, active: Active) -> Deadlines:
        limits, patience = deadlines(active.recipe, self.pace()), self._settings.patience
        whole_s = min(patience * limits.inspection_s, LONGEST_S - _RECORD_NO_RESULT_S)
        return Deadlines(
            {state: patience * limit_s for state, limit_s in limits.phases_s.items()},
            min(whole_s, self._settings.inspection_deadline_s or whole_s),
        )

    def pace(self) -> Pace:
        """What the deadlines follow from on this cell."""
        cell = self._crew.cell
        return Pace(
            frames_per_s=cell.camera.description.frames_per_s or _FRAMES_PER_S,
            arm_move_s=0.0 if cell.arm is None else longest_move_s(self._configuration.arm),
            stroke_mm=cell.gripper.max_width_mm,
            record_s=self._configuration.records.deadline_s,
            measure_s=_MEASURE_S,
        )

    def _signed(self, record: InspectionRecord) -> InspectionRecord:
        return replace(record, devices=self._crew.names, versions=self._versions)

    def _tell_late(self) -> None:
        now = self._now
        if now is None or now.accepted_s is None or self._told_late is self.state:
            return
        since_s = None if now.standing is not None else time.monotonic() - now.accepted_s
        found = late(now.limits, self.state, self.conductor.in_state_s, since_s)
        if found is not None:
            self._told_late = self.state
            what = "the inspection" if found.event is Event.LATE else self.state.value.replace("_", " ")
            why = f"{what} took {found.took_s:.1f} s, at most {found.allowed_s:.1f} s are allowed"
            self.conductor.post(found.event, why)

    def _in_background(self, work: Awaitable[Event | None]) -> None:
        task = asyncio.ensure_future(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)


def longest_move_s(arm: ArmSettings) -> float:
    """The longest way between two of the arm's places: its leading joint speeds up, travels and brakes.

    Args:
        arm: poses, speed and acceleration.
    """
    places = [arm.poses.joints_rad(pose) for pose in POSES]
    ways_rad = [max(abs(a - b) for a, b in zip(*pair, strict=True)) for pair in combinations(places, 2)]
    return max(ways_rad) / arm.joint_speed_rad_s + arm.joint_speed_rad_s / arm.joint_acceleration_rad_s2
