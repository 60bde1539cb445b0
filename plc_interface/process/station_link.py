"""The handshake's requests to the station over the channel."""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    Line,
    Noted,
    Open,
    Outcome,
    Published,
    Resume,
    StationState,
)
from station.channel.messages import ChannelError, DeadlineError, RefusedError
from station.clock import utc_ms
from station.messages.records import NEVER_BEGUN
from station.settings.plc import HandshakeSettings

OUTCOME_GRACE_S = 1.0
"""How much longer than the interface's own deadline it waits for an outcome, so that a late one is logged.

An estimate.
"""
_NOTE_TRIES = 3
"""A note that was refused may have been spoilt on its way; the station takes the same note again without effect."""
_NOTE_AGAIN_S = 0.25
_NOTE_LATER_S = 10.0
"""After `_NOTE_TRIES` refusals a note is repeated at this period: the station's records cannot be written.

An estimate.
"""
_ASK_AGAIN_S = 2.0
"""Without an answer for this time the outcome is requested again; the station answers every request. An estimate."""

log = logging.getLogger(__name__)


def now() -> ev.Moment:
    """Return the time on both clocks."""
    return ev.Moment(time.monotonic(), utc_ms())


class StationLink:
    """Carries out the handshake's requests, and sends beats. Belongs to one event loop."""

    def __init__(
        self, endpoint: str, settings: HandshakeSettings, feed: Callable[[ev.Event], None], line: Callable[[], Line]
    ) -> None:
        """Prepare the link; `feed` gets every answer, and `line` is sent with each beat from `start` on."""
        self._settings, self._feed, self._line = settings, feed, line
        self._client = ChannelClient(endpoint, "the station")
        self._notes: deque[do.NotifyPublished | do.NotifyAcknowledged] = deque()
        self._noting: asyncio.Task[None] | None = None
        self._refused: dict[do.NotifyPublished | do.NotifyAcknowledged, None] = {}
        """Notes that the station did not take, in their order."""
        self._repeating: asyncio.Task[None] | None = None
        self._outcomes: dict[int, asyncio.Task[None]] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._beat_now = asyncio.Event()
        self._logged = ""

    def start(self) -> None:
        """Start the beats."""
        self._spawn(self._beat(), "beats")

    async def stop(self) -> None:
        """End every request."""
        tasks = tuple(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._client.close()

    def carry_out(self, action: do.Action) -> None:
        """Send a request; its answer arrives as an event. Actions that are not for the station are ignored."""
        match action:
            case do.RequestBegin():
                self._spawn(self._begin(action), f"begin {action.trigger_id}")
            case do.RequestOutcome():
                if action.sequence in self._outcomes:
                    self._outcomes[action.sequence].cancel()
                self._outcomes[action.sequence] = self._spawn(self._outcome(action), f"outcome {action.sequence}")
            case do.RequestOpen():
                self._spawn(self._open(action), "open")
            case do.RequestCommand():
                self._spawn(self._command(action), f"command {action.command}")
            case do.NotifyPublished() | do.NotifyAcknowledged():
                self._notes.append(action)
                if self._noting is None or self._noting.done():
                    self._noting = self._spawn(self._note(), "notes")
            case _:
                pass

    def _spawn(self, work: Coroutine[Any, Any, None], name: str) -> asyncio.Task[None]:
        task = asyncio.create_task(work, name=f"station: {name}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _beat(self) -> None:
        period_s = self._settings.beat_period_s
        deadline_s = max(2 * period_s, self._settings.station_lost_after_s / 3)
        while True:
            self._beat_now.clear()
            asked_s = now().s
            try:
                state = await self._client.request(self._line(), StationState, deadline_s=deadline_s)
            except ChannelError as error:
                if str(error) != self._logged:
                    log.warning("%s", error)
                self._logged = str(error)
            else:
                self._logged = ""
                self._feed(ev.Beat(now(), state, asked_s))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(period_s):
                    await self._beat_now.wait()

    async def _begin(self, action: do.RequestBegin) -> None:
        request = Begin(
            trigger_id=action.trigger_id,
            encoder=action.encoder,
            lot=action.lot,
            fruit_length_mm_x10=action.fruit_length_mm_x10,
            size_class=action.size_class,
        )
        try:
            begun = await self._client.request(request, BeginReply, deadline_s=self._settings.begin_deadline_s)
        except ChannelError as error:
            log.warning("%s", error)
            self._feed(ev.BeginFailed(now(), action.number))
        else:
            self._feed(ev.BeginAnswered(now(), action.number, begun))

    async def _outcome(self, action: do.RequestOutcome) -> None:
        try:
            outcome = await self._awaited(action.sequence, time.monotonic() + action.within_s + OUTCOME_GRACE_S)
            event = ev.OutcomeReceived(now(), outcome)
        except ChannelError as error:
            event = ev.OutcomeFailed(now(), action.sequence, str(error))
        if self._outcomes.get(action.sequence) is asyncio.current_task():
            del self._outcomes[action.sequence]
        self._feed(event)
        if isinstance(event, ev.OutcomeReceived):
            self._beat_now.set()  # the station may be ready for the next trigger at once

    async def _awaited(self, sequence: int, ends_s: float) -> Outcome:
        """Ask for an outcome, again where no answer comes: a request or its answer may be lost on the way."""
        while True:
            left_s = max(0.0, ends_s - time.monotonic())
            try:
                return await self._client.request(
                    AwaitOutcome(sequence=sequence), Outcome, deadline_s=min(_ASK_AGAIN_S, left_s)
                )
            except DeadlineError:
                if left_s <= _ASK_AGAIN_S:
                    raise

    async def _open(self, action: do.RequestOpen) -> None:
        try:
            opened = await self._client.request(Resume(), Open, deadline_s=self._settings.station_lost_after_s)
        except ChannelError as error:
            self._feed(ev.RequestFailed(now(), str(error)))
        else:
            self._feed(ev.OpenAnswered(now(), action.number, opened))

    async def _command(self, action: do.RequestCommand) -> None:
        request = Command(command=action.command, argument=action.argument)
        try:
            done = await self._client.request(request, CommandDone, deadline_s=self._settings.command_deadline_s)
        except RefusedError as error:
            self._feed(ev.CommandAnswered(now(), action.number, done=False, why=str(error)))
        except ChannelError as error:
            log.warning("%s", error)
            self._feed(ev.CommandFailed(now(), action.number))
        else:
            self._feed(ev.CommandAnswered(now(), action.number, done.done, str(done.why or "")))

    async def _note(self) -> None:
        """Send notes one after the other, so that an acknowledgement overtakes its outcome only where that was refused.

        The station then leaves it out, and the next acknowledgement, or the resynchronisation, covers it.
        """
        refused = 0
        while self._notes:
            action = self._notes[0]
            published = isinstance(action, do.NotifyPublished)
            request = Published(outcome=action.outcome) if published else Acknowledged(sequence=action.sequence)
            try:
                await self._client.request(request, Noted, deadline_s=self._settings.station_lost_after_s)
            except RefusedError as error:
                if action not in self._refused:
                    log.warning("the station did not take a note: %s", error)
                    refused += 1
                    if refused < _NOTE_TRIES:
                        await asyncio.sleep(_NOTE_AGAIN_S)
                        continue
                    self._repeat_later(action)
                if NEVER_BEGUN.id in error.message.ids():  # no repetition helps
                    self._refused.pop(action, None)
            except ChannelError as error:
                self._notes.clear()  # resynchronisation publishes final outcomes again
                self._refused.clear()
                self._feed(ev.RequestFailed(now(), str(error)))
                return
            else:
                self._refused.pop(action, None)
                if published:
                    self._feed(ev.OutcomeNoted(now(), action.outcome.sequence))
            refused = 0
            self._notes.popleft()

    def _repeat_later(self, action: do.NotifyPublished | do.NotifyAcknowledged) -> None:
        """Repeat a refused note until the station takes it: till then its record may have another outcome than the PLC.

        No resynchronisation need come before the station's next start, which would find the outcome unpublished.
        """
        self._refused[action] = None
        if self._repeating is None or self._repeating.done():
            self._repeating = self._spawn(self._repeat(), "refused notes")

    async def _repeat(self) -> None:
        while self._refused:
            await asyncio.sleep(_NOTE_LATER_S)
            for action in self._refused:
                if action not in self._notes:
                    self.carry_out(action)
