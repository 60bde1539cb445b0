"""Line I/O by CAN: brings up the bus, diverts fruit at an encoder count, and reports faults.

The station moves nothing directly: the gate actuates at a count that it got in advance, and without the station's
heartbeat it sets its safe output. Unverified on hardware.
"""

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TypeVar

from plc_interface.outputs.can import bring_up
from plc_interface.outputs.can.counts import RANGE, ahead, further
from plc_interface.outputs.can.emergency import described_emergency, is_reset
from plc_interface.outputs.can.errors import (
    BringUpError,
    EchoMissingError,
    InterfaceError,
    LateRejectError,
    LineIoError,
    NodeLostError,
    NotReadyError,
    RejectError,
    RejectRefusedError,
)
from plc_interface.outputs.can.link import HEARTBEAT, ORDER, STATES, CanLink, Emergency, Report
from plc_interface.outputs.can.pending_rejects import DivertEcho, Fired, Order, PendingReject, PendingRejects
from station.messages import can as messages
from station.messages.message import Message
from station.settings.can import CanSettings

_LONGEST_PAUSE_S = 10.0
"""Upper limit of the pause before the bus is brought up again, which doubles from `can.retry_s`. An estimate."""
_LANES = 8
"""Lanes of the gate, as in its data sheet."""
_OPERATIONAL, _PRE_OPERATIONAL = 5, 127

Result = TypeVar("Result")
log = logging.getLogger(__name__)


class _HealthEndedError(LineIoError):
    """The station's health has expired: no failure of the bus."""


class LineIo:
    """The station's end of the bus. Make, start, stop and use it on one loop."""

    def __init__(self, settings: CanSettings) -> None:
        self._settings, self._sheets = settings, bring_up.read_data_sheets(settings)
        self._counters: Counter[str] = Counter()
        self._rejects = PendingRejects(self._counters, settings.tolerance_counts)
        self._emergencies: dict[tuple[int, int], Message] = {}
        self._healthy_until_s = 0.0
        self._link: CanLink | None = None
        self._operational = False
        self._pause_s = settings.retry_s
        self._trouble: Message | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._worker: ThreadPoolExecutor | None = None

    async def start(self) -> None:
        """Start bringing up the bus, and restore it whenever it is lost; returns at once. Idempotent."""
        if not self._tasks:
            self._worker = ThreadPoolExecutor(1, "CAN worker")
            self._tasks = [
                asyncio.create_task(self._keep_up(), name="CAN keep up"),
                asyncio.create_task(self._beat(), name="CAN heartbeat"),
            ]

    async def stop(self) -> None:
        """End the heartbeat and close the bus: the gate sets its safe output. Idempotent."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks = []
        if self._worker:
            self._worker.shutdown()
            self._worker = None

    def renew_health(self, valid_s: float) -> None:
        """Declare the station healthy for so many seconds; after these its heartbeat stops."""
        self._healthy_until_s = time.monotonic() + valid_s

    @property
    def ready(self) -> bool:
        """True if a reject actuation can be ordered now."""
        return self.why_not_ready is None

    @property
    def why_not_ready(self) -> Message | None:
        """Return the reason with the remedy; None if ready."""
        if not self._tasks:
            return messages.NOT_STARTED()
        if not self._healthy:
            return messages.UNHEALTHY()
        if not self._operational:
            return self._trouble or messages.COMING_UP()
        if self.encoder_count() is None:
            return messages.NO_COUNT()
        return next(iter(self._emergencies.values()), None)

    @property
    def bus_faults(self) -> tuple[Message, ...]:
        """Return the faults of the bus and its nodes."""
        trouble = (self._trouble,) if self._trouble else ()
        return (*trouble, *self._emergencies.values())

    @property
    def reject_faults(self) -> tuple[Message, ...]:
        """Return the failed reject actuations since the last acknowledgement."""
        return tuple(self._rejects.faults)

    def give_up(self, error: RejectError) -> None:
        """Count a reject actuation that is not ordered at all, and store it as a fault."""
        self._rejects.blame(error)

    def acknowledge_faults(self) -> None:
        """Clear the faults of reject actuations; those of the bus and its nodes end with their cause."""
        self._rejects.faults.clear()

    @property
    def counters(self) -> Mapping[str, int]:
        """Return the counters since the start, by name; docs/plc/can.md lists them."""
        return dict(self._counters)

    def encoder_count(self) -> int | None:
        """Return the encoder's last count, 0 to 2**32 - 1; None if it is stale or there is none."""
        if self._link is None or self._link.count is None:
            return None
        value, at_s = self._link.count
        return value if time.monotonic() - at_s <= self._settings.count_stale_s else None

    def count_at_gate(self, count_at_nest: int) -> int:
        """Return the count at which a fruit reaches the gate, from that when it was at the nest."""
        return further(count_at_nest, self._settings.distance_counts)

    async def divert(self, sequence: int, lane: int, at_count: int) -> DivertEcho:
        """Open the flap of a lane when the belt reaches a count; returns when the gate has reported it.

        Several orders may be pending. The gate retains an order when the caller is cancelled.

        Args:
            sequence: the inspection's, 1 to 2**32 - 1; the gate sees its lower 16 bits.
            lane: 1 to 8.
            at_count: the encoder's count at which the flap opens, 0 to 2**32 - 1; at most 2**31 - 1 ahead.

        Raises:
            NotReadyError: nothing was ordered.
            LateRejectError, RejectRefusedError: the gate does not actuate.
            InterfaceError: the order did not leave.
            EchoMissingError, EchoWrongError, RejectLostError: the gate's action, if any, is not the ordered one.
        """
        if not 1 <= sequence < RANGE or not 1 <= lane <= _LANES or not 0 <= at_count < RANGE:
            found = {"sequence": str(sequence), "lane": str(lane), "at_count": str(at_count)}
            raise RejectRefusedError(sequence, messages.ORDER_MALFORMED(most=str(RANGE - 1), lanes=_LANES, **found))
        link, now = self._link, self.encoder_count()
        if (why_not := self.why_not_ready) is not None or link is None or now is None:
            why = messages.NOT_ORDERED(why=why_not or messages.NO_COUNT())
            raise NotReadyError(messages.SHOT(sequence=sequence, what=why))
        # Expected before it is sent: the gate may report at once.
        with self._rejects.under_way(Order(sequence, lane, at_count)) as pending:
            if ahead(now, at_count) <= 0:
                raise LateRejectError(sequence, messages.COUNT_PAST(at_count=at_count, now_count=now))
            began_s = time.monotonic()
            self._counters["shots_ordered"] += 1
            link.send(
                0x200 + self._settings.gate_node,
                ORDER.pack(pending.order.on_wire, lane, self._settings.pulse_ms, at_count),
            )
            report = await self._confirmed(pending)
            confirmed_s = time.monotonic() - began_s
            while report.fired != Fired.FIRED:
                report = await self._fired(pending, began_s)
            self._counters["shots_fired"] += 1
            return DivertEcho(sequence, lane, at_count, report.encoder_count, confirmed_s)

    async def _confirmed(self, pending: PendingReject) -> Report:
        try:
            async with asyncio.timeout(self._settings.echo_deadline_s):
                return await pending.next()
        except TimeoutError:
            self._counters["echoes_missing"] += 1
            raise EchoMissingError(
                pending.order.sequence, messages.NOT_CONFIRMED(limit_s=self._settings.echo_deadline_s)
            ) from None

    async def _fired(self, pending: PendingReject, began_s: float) -> Report:
        """Wait until the belt reaches the count, however slowly, and then for the report."""
        at = pending.order.at_count
        passed_s: float | None = None
        while True:
            with suppress(TimeoutError):
                async with asyncio.timeout(bring_up.POLL_S):
                    return await pending.next()
            now_s, count = time.monotonic(), self.encoder_count()
            if passed_s is None and count is not None and ahead(count, at) <= 0:
                passed_s = now_s
            if passed_s and now_s - passed_s > self._settings.echo_deadline_s:
                what = messages.NOT_REPORTED(at_count=at)
            elif now_s - began_s > self._settings.shot_deadline_s:
                what = messages.BELT_SLOW(at_count=at, limit_s=self._settings.shot_deadline_s)
            else:
                continue
            self._counters["echoes_missing"] += 1
            raise EchoMissingError(pending.order.sequence, what)

    @property
    def _healthy(self) -> bool:
        return time.monotonic() < self._healthy_until_s

    async def _beat(self) -> None:
        """Send the station's heartbeat from this loop: if the loop hangs, the heartbeat stops, as it has to."""
        while True:
            if self._healthy and self._link:
                try:
                    self._send_beat(self._link)
                except InterfaceError:
                    self._counters["send_errors"] += 1
            await asyncio.sleep(self._settings.heartbeat_s)

    def _send_beat(self, link: CanLink) -> None:
        if not self._healthy:
            raise _HealthEndedError(messages.UNHEALTHY())
        link.send(HEARTBEAT + self._settings.station_node, bytes([_OPERATIONAL]))

    async def _keep_up(self) -> None:
        while True:
            try:
                while not self._healthy:
                    await asyncio.sleep(bring_up.POLL_S)
                await self._session()
            except _HealthEndedError:
                self._trouble, self._pause_s = None, self._settings.retry_s
                continue
            except NodeLostError as error:
                self._failed("nodes_lost", error.message)
            except LineIoError as error:
                self._failed("bring_up_failures", error.message)
            except Exception:
                log.exception("the CAN driver failed")
                self._failed("bring_up_failures", messages.DRIVER_FAILED())
            await asyncio.sleep(self._pause_s)
            self._pause_s = min(2 * self._pause_s, _LONGEST_PAUSE_S)

    def _failed(self, counter: str, why: Message) -> None:
        self._counters[counter] += 1
        if why != self._trouble:
            log.warning("%s", why)
        self._trouble = why

    async def _session(self) -> None:
        """Open the bus, bring both nodes up and monitor them until the session ends.

        Raises:
            LineIoError: the bus or a node is not available or was lost, or the station is no longer healthy.
        """
        loop = asyncio.get_running_loop()
        link = CanLink(
            self._settings,
            self._counters,
            lambda report: loop.call_soon_threadsafe(self._rejects.on_report, report),
            lambda emergency: loop.call_soon_threadsafe(self._on_emergency, emergency),
        )
        self._link, why = link, messages.DRIVER_STOPPED()
        self._emergencies.clear()
        try:
            await self._bring_up(link)
            self._operational, self._trouble, self._pause_s = True, None, self._settings.retry_s
            self._counters["bring_ups"] += 1
            await self._watch(link)
        except LineIoError as error:
            why = error.message
            raise
        finally:
            self._operational, self._link = False, None
            self._rejects.lose(why)
            link.abort()
            await self._in_worker(link.close)

    async def _bring_up(self, link: CanLink) -> None:
        settings = self._settings
        gate = bring_up.make_gate(link.network, settings, self._sheets)
        encoder = bring_up.make_encoder(link.network, settings, self._sheets)
        for node in (gate, encoder):
            await self._until(
                link, lambda node=node: self._alive(link, node.number), bring_up.no_heartbeat(node, settings)
            )
            await self._in_worker(lambda node=node: bring_up.verify_identity(node))
            await self._order(link, node, "PRE-OPERATIONAL", _PRE_OPERATIONAL)
        await self._in_worker(lambda: bring_up.configure_encoder(encoder, settings))
        await self._in_worker(lambda: bring_up.configure_gate(gate, settings))
        for node in (encoder, gate):
            if standing := await self._in_worker(lambda node=node: bring_up.active_error(node)):
                self._on_emergency(Emergency(node.number, *standing))
            # The gate watches the station from the first heartbeat after its configuration (CiA 301). One is sent just
            # before the order, so that it is never operational for a station that has gone.
            self._send_beat(link)
            await self._order(link, node, "OPERATIONAL", _OPERATIONAL)
        # A count of before is not the gate's, which would refuse an order as late: not ready until both have the next.
        link.count = None

    async def _order(self, link: CanLink, node: bring_up.Node, name: str, state: int) -> None:
        """Command a state and wait until the node's heartbeat reports it."""
        sent_s = time.monotonic()
        try:
            node.remote.nmt.state = name
        except Exception as error:
            raise InterfaceError(messages.BUS_FAILED(error=str(error))) from error

        def obeyed() -> bool:
            beat = link.beats[node.number]
            return beat.state == state and beat.at_s > sent_s

        await self._until(link, obeyed, messages.STATE_REFUSED(node=node.name, state=STATES[state]))

    def _alive(self, link: CanLink, node: int) -> bool:
        beat = link.beats.get(node)
        return beat is not None and time.monotonic() - beat.at_s < self._settings.heartbeat_lost_s

    async def _until(self, link: CanLink, condition: Callable[[], bool], why: Message) -> None:
        deadline_s = time.monotonic() + max(bring_up.NODE_DEADLINE_S, 3 * self._settings.heartbeat_lost_s)
        while not condition():
            link.check()
            if not self._healthy:
                raise _HealthEndedError(messages.UNHEALTHY())
            if time.monotonic() > deadline_s:
                raise BringUpError(why)
            await asyncio.sleep(bring_up.POLL_S)

    async def _watch(self, link: CanLink) -> None:
        while self._healthy:
            link.check()
            for node in (self._settings.gate_node, self._settings.encoder_node):
                if not self._alive(link, node):
                    raise NodeLostError(messages.SILENT(node=self._name(node)))
                state = link.beats[node].state
                if state != _OPERATIONAL:
                    state_name = STATES.get(state, str(state))
                    raise NodeLostError(messages.STATE_CHANGED(node=self._name(node), state=state_name))
            await asyncio.sleep(bring_up.POLL_S)
        raise _HealthEndedError(messages.UNHEALTHY())

    def _on_emergency(self, emergency: Emergency) -> None:
        node, code, register = emergency
        if is_reset(code):
            if not register:  # else one error has gone and others remain (CiA 301, 7.2.7)
                self._emergencies = {key: text for key, text in self._emergencies.items() if key[0] != node}
            return
        self._counters["emergencies"] += 1
        self._emergencies[node, code] = described_emergency(self._name(node), code, register)

    def _name(self, node: int) -> Message:
        return (messages.GATE if node == self._settings.gate_node else messages.ENCODER)(node=node)

    def _in_worker(self, work: Callable[[], Result]) -> Awaitable[Result]:
        """Run a blocking function in the one worker thread."""
        return asyncio.get_running_loop().run_in_executor(self._worker, work)
