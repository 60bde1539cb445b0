"""Arm link: starts, monitors and restarts the ur-rtde process of one controller.

The link reconnects by itself after a drop, however often: ur-rtde's process ends with a dropped link, so its ends say
nothing of their cause. A fault that a person has to check remains until that person's command: a stop of any kind, a
program that no longer plays.
"""

import asyncio
import contextlib
import logging
import time
from typing import NoReturn

from station.devices.arm.dashboard import dashboard
from station.devices.arm.diagnosis import PLAYING, STATE_CAUSES, STOPPED, diagnose, from_output, from_state
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import (
    Beat,
    Beside,
    Command,
    Halt,
    Move,
    Outcome,
    Reachable,
    Snapshot,
    Start,
    Upload,
    Watch,
)
from station.devices.arm.process_handle import ArmProcess
from station.messages import arm as messages
from station.messages.message import Message
from station.settings.arm import ArmSettings

BEAT_S = 0.1
"""Period of the state's query while the link is up, s; an estimate."""
BEAT_DEADLINE_S = 1.0
"""Longest wait for the answer of a query, s; an estimate."""
FIRST_PAUSE_S = 0.2
"""Pause between two attempts to connect, s, doubled for each failure in a row; an estimate."""
LONGEST_PAUSE_S = 3.0
"""Longest pause between two attempts to connect, s; an estimate."""
UPLOAD_TRIES = 3
"""Starts of a program that does not come to play, before a person is called."""
SETTLE_S = 0.5
"""Longest lag of RTDE behind the dashboard server, and longest wait for a started program to play, s; an estimate."""
POLL_S = 0.01
"""Period of the state's query after a program's start, s; an estimate."""
FIRST_LEASE_S = 2.0
"""Health lease at the opening, s, until the caller renews it; an estimate."""
END_AGAIN_S = 1.0
"""Pause before a stop is sent again, s; an estimate."""
PROCESS_START_LIMIT_S = 60.0
"""As the supervisor gives each of the station's processes."""
OWN_CLAIM_S = 15.0
"""Longest time for which a controller may hold the input registers for a commanding connection of this station that was
cut, s; it drops a client that does not read after about 10 s (an estimate, unverified on hardware)."""
SELF_HEALING = {ArmCause.LINK_LOST, ArmCause.STALE, ArmCause.DEADLINE}
"""Causes that a new process may clear without a person."""

log = logging.getLogger(__name__)


class ArmLink:
    """Link to one controller, maintained by a task of its own. All access to the process is serialised."""

    def __init__(self, settings: ArmSettings) -> None:
        self._settings = settings
        self._process: ArmProcess | None = None
        self._lost: ArmFault | None = None
        self._latched: ArmFault | None = ArmFault(ArmCause.CLOSED, messages.NOT_OPENED())
        self._failures = 0
        self._healthy_until_s = 0.0
        self._was_healthy = True
        self._tries_left = UPLOAD_TRIES
        self._end_again_s = 0.0
        self._own_claim_until_s = 0.0
        self._lock = asyncio.Lock()
        self._maintaining: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()
        self.fault_since_s = 0.0
        """When the fault was seen, on the machine's monotonic clock."""
        self.attachment = 0
        """Counts the programs that were brought to play: what was learnt from an earlier one may not hold any more."""

    @property
    def fault(self) -> ArmFault | None:
        """Return why nothing can be moved: a lost link, or a fault that waits for a person; None if ready."""
        return self._lost or self._latched

    @property
    def lost(self) -> ArmFault | None:
        """Return why the arm's state is unknown; None if the link is up, also with a fault that waits for a person."""
        return self._lost

    @property
    def pid(self) -> int | None:
        """Return the id of the present process."""
        return self._process.pid if self._process is not None else None

    @property
    def healthy(self) -> bool:
        """True while the lease of the station's health has not expired."""
        return time.monotonic() < self._healthy_until_s

    def renew_health(self, lease_s: float) -> None:
        """Renew the health lease, in seconds from now."""
        self._healthy_until_s = time.monotonic() + lease_s

    async def open(self) -> None:
        """Start to maintain the link."""
        if self._maintaining is None:
            self.renew_health(FIRST_LEASE_S)
            self._lost, self._latched = ArmFault(ArmCause.LINK_LOST, messages.NOT_CONNECTED_YET()), None
            self._maintaining = asyncio.create_task(self._keep(), name="the arm's link")

    async def close(self) -> None:
        """End the process. Idempotent."""
        if self._maintaining is not None:
            self._maintaining.cancel()
            await asyncio.gather(self._maintaining, return_exceptions=True)
            self._maintaining = None
        async with self._lock:
            await self._drop()
        self._set(ArmFault(ArmCause.CLOSED, messages.CLOSED()))

    async def settled(self, deadline_s: float) -> None:
        """Wait until the arm is ready or waits for a person.

        Raises:
            ArmFault: it is not ready.
        """
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(deadline_s):
                while self._lost is not None:
                    self._changed.clear()
                    await self._changed.wait()
        if self.fault is not None:
            raise self.fault.again()

    async def snapshot(self) -> Snapshot:
        """Read the controller's state now; the request's duration is added to its age.

        Raises:
            ArmFault: there is none.
        """
        process = self._process
        if process is None:
            raise (self.fault or ArmFault(ArmCause.LINK_LOST, messages.NOT_CONNECTED())).again()
        limit_s, begun_s = self._settings.stale_after_s, time.monotonic()
        try:
            snapshot = await self._state(process, limit_s)
        except ArmFault as fault:
            if fault.cause is ArmCause.DEADLINE:
                raise ArmFault(ArmCause.STALE, messages.STATE_LATE(limit_s=limit_s)) from fault
            if self.fault is None and process is self._process:
                self._set(fault)
            raise
        return snapshot.model_copy(update={"age_s": snapshot.age_s + time.monotonic() - begun_s})

    async def order(self, request: Beside | Move | Reachable | Halt) -> Outcome:
        """Send a command to the process; if it does not answer it is ended, and the watchdog stops the arm.

        Raises:
            ArmFault: there is no process, it gave no answer, or the controller's state became too old meanwhile.
        """
        limit_s = self._settings.call_deadline_s
        try:
            async with asyncio.timeout(limit_s):
                await self._lock.acquire()
        except TimeoutError as error:
            busy = ArmFault(ArmCause.BUSY, messages.LINK_BUSY(limit_s=limit_s, request=request.meaning))
            raise (self.fault or busy).again() from error
        try:
            process = self._process
            if process is None:
                raise (self.fault or ArmFault(ArmCause.LINK_LOST, messages.NOT_CONNECTED())).again()
            try:
                return await self._ask_watched(process, request)
            except ArmFault as fault:
                await self._lose(fault)
                raise
        finally:
            self._lock.release()

    async def _ask_watched(self, process: ArmProcess, request: Beside | Move | Reachable | Halt) -> Outcome:
        asking = asyncio.create_task(process.request(request, Outcome, deadline_s=self._settings.call_deadline_s))
        fading = asyncio.create_task(self._until_faded(process))
        try:
            await asyncio.wait({asking, fading}, return_when=asyncio.FIRST_COMPLETED)
            return asking.result() if asking.done() else fading.result()
        finally:
            for task in (asking, fading):
                task.cancel()
            await asyncio.gather(asking, fading, return_exceptions=True)

    async def _until_faded(self, process: ArmProcess) -> NoReturn:
        while True:
            await asyncio.sleep(BEAT_S)
            await self._heard(process)

    async def _state(self, process: ArmProcess, deadline_s: float) -> Snapshot:
        """Read the state, of any age: ur-rtde returns the last one also for a connection that is cut."""
        snapshot = await process.request(self._beat_message(), Snapshot, deadline_s=deadline_s)
        if not snapshot.connected:
            raise ArmFault(ArmCause.LINK_LOST, messages.LINK_CUT())
        return snapshot

    async def _heard(self, process: ArmProcess) -> Snapshot:
        snapshot = await self._state(process, BEAT_DEADLINE_S)
        if snapshot.age_s > self._settings.link_lost_after_s:
            raise ArmFault(ArmCause.LINK_LOST, messages.STATE_OLD(age_s=snapshot.age_s))
        if snapshot.commanding:
            self._own_claim_until_s = time.monotonic() + OWN_CLAIM_S
        return snapshot

    async def upload(self) -> None:
        """Start the program, over the present link or a new one; a playing one does not change.

        Raises:
            ArmFault: it does not play.
        """
        async with self._lock:
            self._was_healthy = self.healthy
            for attempt in range(UPLOAD_TRIES):
                try:
                    await self._play()
                except ArmFault as fault:
                    anew = fault.cause in SELF_HEALING or fault.cause is ArmCause.PROGRAM_STOPPED
                    last = not anew or attempt == UPLOAD_TRIES - 1
                    # What the next attempt may end is not reported: a reset that waits for this upload would take it
                    # for a new stop, which waits for a person.
                    if last or self.fault is None:
                        self._set(fault)
                    if anew:
                        await self._drop()
                    if last:
                        raise
                else:
                    return

    async def _play(self) -> None:
        process = self._process or await self._connect()
        snapshot = await self._free_to_move(process)
        if not snapshot.commanding:
            await self._command(process)
            if self.fault is not None:
                raise self.fault.again()
        elif snapshot.runtime_state != PLAYING:
            done = await process.request(Upload(), Outcome, deadline_s=self._settings.constructor_limit_s)
            if not (done.done and await self._plays(process)):
                raise await self._explain(done.output)
            self._up()
        else:
            self._set(None)

    async def _free_to_move(self, process: ArmProcess) -> Snapshot:
        # The RTDE state may lag a little behind the dashboard server's reply.
        deadline_s = time.monotonic() + SETTLE_S
        while True:
            snapshot = await self._state(process, BEAT_DEADLINE_S)
            fault = from_state(snapshot)
            if fault is None:
                return snapshot
            if time.monotonic() > deadline_s:
                raise fault
            await asyncio.sleep(BEAT_S)

    async def _keep(self) -> None:
        while True:
            async with self._lock:
                try:
                    await self._step()
                except ArmFault as fault:
                    await self._lose(fault)
                except Exception as error:  # the link outlives any other failure
                    log.exception("the arm's link")
                    await self._lose(ArmFault(ArmCause.LINK_LOST, messages.PROCESS_UNUSABLE(reason=str(error))))
            await asyncio.sleep(self._pause_s())

    def _pause_s(self) -> float:
        if self._failures == 0:
            return BEAT_S
        return min(FIRST_PAUSE_S * 2.0 ** min(self._failures, 16), LONGEST_PAUSE_S)

    async def _step(self) -> None:
        if self._process is not None:
            await self._watch(self._process)
        else:
            process = await self._connect()
            snapshot = await self._state(process, BEAT_DEADLINE_S)
            fault = from_state(snapshot) or self._latched
            if fault is None:
                await self._command(process)
            else:
                self._set(fault)

    async def _watch(self, process: ArmProcess) -> None:
        if not self.healthy:
            self._was_healthy = False
        snapshot = await self._heard(process)
        self._failures = 0
        if self.healthy and snapshot.runtime_state == PLAYING and not snapshot.kicks_late:
            # The lapse was shorter than the watchdog's limit: it does not explain a stop from now on. A stop by the
            # watchdog that this state is too old to show has late kicks; without them a person has to check.
            self._was_healthy = True
        seen = from_state(snapshot)
        latched = self._latched.cause if self._latched is not None else None
        if seen is not None and seen.cause is not latched:
            self._set(seen)
        if seen is not None or latched is ArmCause.SAFEGUARD_STOP:
            await self._end_program(snapshot)
        elif latched is not None and latched not in STATE_CAUSES:
            if latched is ArmCause.PROGRAM_STOPPED and snapshot.runtime_state != PLAYING:
                await self._end_program(snapshot)
        elif snapshot.runtime_state != PLAYING:
            # After a stop a person starts the program, however the station's health was meanwhile.
            self._store_or_raise(await self._explain(None, by_state=latched is not None))
            await self._end_program(snapshot)
        elif self._lost is not None:
            self._set(None)

    async def _end_program(self, snapshot: Snapshot) -> None:
        """Stop a program that is only paused, as by an open guard: it would complete its motion when the guard closes.

        That the dashboard server stops a paused program is unverified on hardware; it is ordered until it has.
        """
        if snapshot.runtime_state in STOPPED or time.monotonic() < self._end_again_s:
            return
        self._end_again_s = time.monotonic() + END_AGAIN_S
        async with dashboard(self._settings.host) as conversation:
            log.info("arm link: a paused program is stopped: %s", await conversation.request("stop"))

    async def _connect(self) -> ArmProcess:
        async with dashboard(self._settings.host):
            pass  # check that a controller answers before a process is started for it
        self._process = await ArmProcess.spawn(self._settings.host, self._settings.frequency_hz)
        # Apart from the constructors' limit: a busy machine may take longer to import the libraries than to connect.
        await self._process.request(Start(), Outcome, deadline_s=PROCESS_START_LIMIT_S)
        outcome = await self._process.request(Watch(), Outcome, deadline_s=self._settings.constructor_limit_s)
        if not outcome.done:
            raise from_output(outcome.output) or ArmFault(
                ArmCause.LINK_LOST, messages.NOTHING_RECEIVED(reason=outcome.output or messages.NO_REASON())
            )
        return self._process

    async def _command(self, process: ArmProcess) -> None:
        settings = self._settings
        request = Command(
            tool_centre_mm=settings.tool_centre_mm,
            payload_kg=settings.payload_kg,
            payload_centre_mm=settings.payload_centre_mm,
            watchdog_hz=settings.watchdog_hz,
        )
        own_claim_until_s = self._own_claim_until_s
        # However this ends, and also where a cut leaves it without an end, it may have claimed the registers.
        self._own_claim_until_s = time.monotonic() + settings.constructor_limit_s + OWN_CLAIM_S
        outcome = await process.request(request, Outcome, deadline_s=settings.constructor_limit_s)
        # The lease that the process knew may have run out while the connection was made: the beats in this renew it
        # before the watchdog that has just been set up expects a kick.
        if outcome.done and await self._plays(process):
            self._up()
            return
        fault = await self._explain(outcome.output)
        if fault.cause is ArmCause.PROGRAM_STOPPED and self._tries_left > 1:
            # Nobody stops a program that was never seen to play: rather the link was cut while it was started.
            self._tries_left -= 1
            raise ArmFault(ArmCause.LINK_LOST, messages.PROGRAM_NOT_BEGUN())
        if fault.cause is ArmCause.REGISTERS_IN_USE:
            self._own_claim_until_s = own_claim_until_s  # it claimed none
            if time.monotonic() < own_claim_until_s:
                raise ArmFault(ArmCause.LINK_LOST, messages.OWN_REGISTERS_HELD())
        self._store_or_raise(fault)

    async def _plays(self, process: ArmProcess) -> bool:
        """Return whether the program just started plays, by a state newer than its start; False if none comes."""
        began_s = time.monotonic()
        while time.monotonic() < began_s + SETTLE_S:
            snapshot = await self._heard(process)
            if snapshot.runtime_state == PLAYING and time.monotonic() - snapshot.age_s > began_s:
                return True
            await asyncio.sleep(POLL_S)
        return False

    async def _explain(self, output: Message | None, *, by_state: bool = False) -> ArmFault:
        fault = from_output(output)
        if fault is not None or self._process is None:
            away = messages.NOT_CONNECTED_BECAUSE(reason=output) if output else messages.NOT_CONNECTED()
            return fault or ArmFault(ArmCause.LINK_LOST, away)
        async with dashboard(self._settings.host) as conversation:
            facts = await conversation.facts()
        snapshot = await self._state(self._process, BEAT_DEADLINE_S)
        was_healthy = by_state or (self._was_healthy and not snapshot.kicks_late)
        return diagnose(snapshot, facts, output, was_healthy=was_healthy)

    async def explain(self, output: Message | None) -> ArmFault:
        """Return why a command was not done, with its output if it gave one; it becomes the link's fault."""
        async with self._lock:
            try:
                fault = await self._explain(output)
                self._store_or_raise(fault)
            except ArmFault as lost:
                fault = lost
                await self._lose(lost)
            return fault

    def _store_or_raise(self, fault: ArmFault) -> None:
        """Store a fault that waits for a person; raise one that a new process may clear."""
        if fault.cause in SELF_HEALING:
            raise fault
        self._set(fault)

    def _beat_message(self) -> Beat:
        return Beat(healthy_for_s=max(0.0, self._healthy_until_s - time.monotonic()))

    def _up(self) -> None:
        self._failures, self._tries_left = 0, UPLOAD_TRIES
        self._was_healthy = self.healthy
        self.attachment += 1
        self._set(None)

    async def _lose(self, fault: ArmFault) -> None:
        self._failures += 1
        await self._drop()
        self._set(fault)

    async def _drop(self) -> None:
        if self._process is not None:
            await self._process.end()
            self._process = None

    def _set(self, fault: ArmFault | None) -> None:
        before = self.fault.message if self.fault is not None else None
        self.fault_since_s = time.monotonic()
        if fault is not None and fault.cause in SELF_HEALING:
            self._lost = fault
        else:
            self._lost, self._latched = None, fault
        now = self.fault.message if self.fault is not None else None
        if now != before:
            log.info("arm link: %s", now or "ready")
        self._changed.set()
