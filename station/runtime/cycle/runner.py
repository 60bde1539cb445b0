"""State machine runner: takes one event after the other and starts the table's actions."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Container
from typing import NamedTuple, Protocol

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import CameraError
from station.devices.gripper.errors import GripperEmergencyStopError, GripperError
from station.errors import StationError
from station.inspection.cycle import LATCHES, Act, Action, Cycle, Event, Raise
from station.inspection.states import State
from station.messages import operation as messages
from station.messages.message import Message, message_of
from station.records.errors import RecordsError
from station.runtime.devices.rig import FramesError

TICK_S = 0.1
"""Longest wait for an event until the next tick, s: an estimate."""
HALT_DEADLINE_S = 5.0
"""Longest wait for the devices to stop, s: an estimate."""

log = logging.getLogger(__name__)

_STOPS = {
    ArmCause.PROTECTIVE_STOP: Event.PROTECTIVE_STOP,
    ArmCause.EMERGENCY_STOP: Event.EMERGENCY_STOP,
    ArmCause.SAFETY_FAULT: Event.SAFETY_FAULT,
    ArmCause.PROGRAM_STOPPED: Event.PROGRAM_STOPPED,
}


def event_of(fault: BaseException) -> Event:
    """The cycle's event for what an action or a watch ran into."""
    match fault:
        case ArmFault():
            return _STOPS.get(fault.cause, Event.ARM_FAULT)
        case GripperEmergencyStopError():
            return Event.EMERGENCY_STOP
        case GripperError():
            return Event.GRIPPER_FAULT
        case CameraError() | FramesError():
            return Event.CAMERA_FAULT
        case RecordsError():
            return Event.RECORDS_FAULT
    return Event.INTERNAL_FAULT


_ON_THE_DISK = {Action.RECORD}
"""What HALT does not touch: it is no motion, and what follows waits for it."""


Work = Callable[[], Awaitable[Event | None]]


class Happened(NamedTuple):
    """An event on its way to the table."""

    event: Event
    why: Message | None
    by: "asyncio.Task[None] | None"
    """The action that ended with it; None where it came from elsewhere."""


class Performer(Protocol):
    """Performer of the cycle's actions."""

    def perform(self, action: Action, because: Happened) -> Work | None:
        """Carry an action out, never HALT; if it takes time, give what runs beside all else and ends with its event."""

    async def halt(self) -> None:
        """Stop the devices where they are; bounded, and raises nothing."""

    def storing(self, event: Event, state: State) -> Awaitable[None] | None:
        """Give what has to be durable before the state that the event leads to is shown; None where nothing changes."""

    def raise_alarm(self, alarm: Raise, why: Message | None) -> None:
        """Raise an alarm, with what was seen."""

    def entered(self, state: State, after: State, took_s: float) -> None:
        """The state has changed; the one before was held for `took_s`."""

    def failed(self, fault: StationError) -> None:
        """An action ran into this; its event follows."""

    def refused(self, state: State, event: Event) -> None:
        """An event came that the table does not list; nothing was done."""

    def tick(self) -> None:
        """Perform what depends on time alone. Called about ten times a second, and after every event."""


class CycleRunner:
    """One task takes the events in their order; the performer's actions run beside it.

    It begins with the hold from the start before, which only a person may end.
    """

    def __init__(self, performer: Performer, hold: Event | None = None) -> None:
        self.cycle, self._hold = Cycle(hold), hold
        self.entered_s = time.monotonic()
        """When the present state was entered, monotonic."""
        self.stopped_s = 0.0
        """When the last event came that only a person may end, monotonic."""
        self._performer = performer
        self._events: asyncio.Queue[Happened] = asyncio.Queue()
        self._doing: dict[asyncio.Task[None], Action] = {}
        self._changed = asyncio.Event()
        self._coming: State | None = None

    @property
    def bound_for(self) -> State:
        """The state, or the next one while what it needs is made durable: HALT comes before it."""
        return self._coming or self.state

    @property
    def state(self) -> State:
        """Present state of the cycle."""
        return self.cycle.state

    @property
    def in_state_s(self) -> float:
        """For how long."""
        return time.monotonic() - self.entered_s

    def post(self, event: Event, why: Message | None = None) -> None:
        """Report an event from outside of the actions, with a reason for a person."""
        self._events.put_nowait(Happened(event, why, None))

    async def taken(self) -> None:
        """Wait until every event that was posted has been taken: the state is what they led to."""
        await self._events.join()

    async def run(self) -> None:
        """Take events until cancelled; then what is under way is cancelled too."""
        try:
            await self._act(self.cycle.begin.actions, Happened(self._hold or Event.RESET, None, None))
            while True:
                try:
                    async with asyncio.timeout(TICK_S):
                        happened = await self._events.get()
                except TimeoutError:
                    pass
                else:
                    await self._take(happened)
                    self._events.task_done()
                self._performer.tick()
        finally:
            await self._forget()

    async def until(self, wanted: Callable[[State], bool]) -> State:
        """Wait for a state."""
        while not wanted(self.state):
            self._changed.clear()
            await self._changed.wait()
        return self.state

    def check_again(self) -> None:
        """Have everyone who waits in `until` check again: something else than the state has changed."""
        self._changed.set()

    async def _take(self, happened: Happened) -> None:
        if happened.by is not None and happened.by not in self._doing:
            return  # its action was halted
        if happened.by is not None:
            del self._doing[happened.by]
        halted = await self._store(happened.event)
        before, actions = self.state, self.cycle.on(happened.event)
        if actions is None:
            log.warning("event %s is not expected in %s: %s", happened.event, before, happened.why or "no reason given")
            self._performer.refused(before, happened.event)
            return
        if happened.event in LATCHES:
            self.stopped_s = time.monotonic()
        if self.state is not before:
            now_s = time.monotonic()
            took_s, self.entered_s = now_s - self.entered_s, now_s
            log.debug("%s → %s on %s", before, self.state, happened.event)
            self._performer.entered(self.state, before, took_s)
        await self._act(actions, happened, halted=halted)
        self._changed.set()

    async def _store(self, event: Event) -> bool:
        """Make durable what only a person may end, before the state that says so; whether HALT was carried out."""
        transition = self.cycle.leads_to(event)
        storing = None if transition is None else self._performer.storing(event, transition.state)
        if transition is None or storing is None:
            return False
        self._coming = transition.state
        try:
            if Action.HALT not in transition.actions:
                await storing
                return False
            await asyncio.gather(storing, self._halt())  # no motion waits for the disk
            return True
        finally:
            self._coming = None

    async def _act(self, actions: tuple[Act, ...], because: Happened, *, halted: bool = False) -> None:
        for act in actions:
            if isinstance(act, Raise):
                self._performer.raise_alarm(act, because.why)
            elif act is Action.HALT:
                if not halted:
                    await self._halt()
            else:
                self._begin(act, because)

    def _begin(self, action: Action, because: Happened) -> None:
        try:
            work = self._performer.perform(action, because)
        except Exception as error:  # a bug in one action must end in an outcome, not in silence
            log.exception("action %s", action)
            self.post(Event.INTERNAL_FAULT, messages.internal_fault(error))
            return
        if work is not None:
            task = asyncio.create_task(self._end_with_event(action, work), name=f"action {action}")
            self._doing[task] = action

    async def _end_with_event(self, action: Action, work: Work) -> None:
        me = asyncio.current_task()
        try:
            event, why = await work(), None
        except StationError as fault:
            event, why = event_of(fault), message_of(fault)
            self._performer.failed(fault)
            if event is Event.INTERNAL_FAULT:
                log.exception("action %s", action)
        except Exception as error:  # as above
            log.exception("action %s", action)
            event, why = Event.INTERNAL_FAULT, messages.internal_fault(error)
        if event is not None:
            self._events.put_nowait(Happened(event, why, me))
        elif me is not None:
            self._doing.pop(me, None)

    async def _halt(self) -> None:
        # Before the devices: an action that goes on could move one again after its stop.
        await self._forget(keep=_ON_THE_DISK)
        try:
            async with asyncio.timeout(HALT_DEADLINE_S):
                await self._performer.halt()
        except TimeoutError:
            log.warning("the devices did not confirm within %g s that they have stopped", HALT_DEADLINE_S)

    async def _forget(self, keep: Container[Action] = ()) -> None:
        left = {task for task, action in self._doing.items() if action not in keep}
        for task in left:
            # Forgotten before it has ended: an event that it still ends with is not taken.
            del self._doing[task]
            task.cancel()
        if left:
            await asyncio.wait(left, timeout=HALT_DEADLINE_S)
