"""Triggers and outcomes in progress, with the callers that wait for each."""

import asyncio
from collections import OrderedDict

from station.channel.line import BeginReply, Outcome
from station.messages import records as messages
from station.records.errors import UnknownInspectionError
from station.runtime.cycle.inspection import Inspection

_REMEMBERED = 64
"""Inspections in memory: an estimate of how many the PLC interface may still come for."""


class RecentTriggers:
    """Last inspections by their sequence, with the callers that wait for them."""

    def __init__(self) -> None:
        self._outcomes: OrderedDict[int, asyncio.Future[Outcome]] = OrderedDict()
        self._inspections: dict[int, Inspection] = {}

    def accepted(self, now: Inspection) -> None:
        """Add a durable trigger whose inspection, with its sequence, has begun; earlier ones release their pictures."""
        assert now.sequence is not None  # noqa: S101 (it is durable)
        for earlier in self._inspections.values():
            earlier.forget_pictures()
        self._inspections[now.sequence] = now
        self._outcomes[now.sequence] = asyncio.get_running_loop().create_future()
        while len(self._outcomes) > _REMEMBERED:
            forgotten, _ = self._outcomes.popitem(last=False)
            self._inspections.pop(forgotten, None)

    def ended(self, outcome: Outcome) -> None:
        """Pass an outcome to the callers that wait for it now or later; a second one is ignored."""
        waiting = self._outcomes.get(outcome.sequence)
        if waiting is not None and not waiting.done():
            waiting.set_result(outcome)

    def inspection(self, sequence: int) -> Inspection | None:
        """Return one of the last inspections."""
        return self._inspections.get(sequence)

    async def outcome(self, sequence: int) -> Outcome:
        """Wait for an outcome of an inspection of this start of the station.

        Raises:
            UnknownInspectionError: none of the last has this number.
        """
        waiting = self._outcomes.get(sequence)
        if waiting is None:
            raise UnknownInspectionError(messages.NOT_THIS_START(number=sequence), messages.ASK_OPEN())
        # Several may wait for it: one that gives up must not cancel it for the others.
        return await asyncio.shield(waiting)


class PendingTrigger:
    """One trigger between its request and its answer."""

    def __init__(self, inspection: Inspection) -> None:
        self.inspection = inspection
        self.recording: asyncio.Future[None] | None = None
        """Task that makes it durable and numbers it; when it is cancelled, the record is withdrawn."""
        self._answer: asyncio.Future[BeginReply] = asyncio.get_running_loop().create_future()

    @property
    def is_answered(self) -> bool:
        """True once the request has its answer, or the error that has ended it."""
        return self._answer.done()

    def answer(self, begun: BeginReply) -> None:
        """Answer the request; a second answer is ignored."""
        if not self.is_answered:
            self._answer.set_result(begun)

    def fail(self, error: Exception) -> None:
        """End the request without an answer, if it has none: it would keep every later one waiting."""
        if not self.is_answered:
            self._answer.set_exception(error)

    async def answered(self) -> BeginReply:
        """Wait for the answer, or raise what has ended the request without one."""
        # A request that is cancelled must not count as answered.
        return await asyncio.shield(self._answer)
