"""Triggers and outcomes on their way: who waits for which answer, and what was already answered."""

import asyncio
from collections import OrderedDict

from station.channel.line import Begin, BeginReply, Outcome
from station.records.errors import UnknownInspectionError
from station.service.inspection import Inspection

_REMEMBERED = 64


class Triggers:
    """The last inspections by their sequence, with those who wait for them."""

    def __init__(self) -> None:
        self._outcomes: OrderedDict[int, asyncio.Future[Outcome]] = OrderedDict()
        self._inspections: dict[int, Inspection] = {}
        self._last: tuple[Begin, int] | None = None
        """The last accepted trigger, until its outcome was published."""

    def repeated(self, request: Begin) -> Inspection | None:
        """The inspection that this very trigger has begun already: a retried request begins none.

        The PLC never gives an id twice in a row; one that comes again before its outcome was told is the same fruit.

        Args:
            request: as it came.
        """
        if self._last is None or self._last[0] != request:
            return None
        return self._inspections.get(self._last[1])

    def accepted(self, request: Begin, now: Inspection) -> None:
        """A trigger is durable and its inspection has begun; those before it were told and need no pictures any more.

        Args:
            request: the trigger.
            now: with its sequence.
        """
        assert now.sequence is not None  # noqa: S101 (it is durable)
        self._last = (request, now.sequence)
        for told in self._inspections.values():
            told.forget_pictures()
        self._inspections[now.sequence] = now
        self._outcomes[now.sequence] = asyncio.get_running_loop().create_future()
        while len(self._outcomes) > _REMEMBERED:
            forgotten, _ = self._outcomes.popitem(last=False)
            self._inspections.pop(forgotten, None)

    def ended(self, outcome: Outcome) -> None:
        """Give an outcome to those who wait for it, or come for it later; the first one stands.

        Args:
            outcome: as recorded.
        """
        waiting = self._outcomes.get(outcome.sequence)
        if waiting is not None and not waiting.done():
            waiting.set_result(outcome)

    def published(self, outcome: Outcome) -> None:
        """The PLC was told; the same trigger is from now on another fruit's.

        Args:
            outcome: what it was told.
        """
        if self._last is not None and self._last[1] == outcome.sequence:
            self._last = None
        self.ended(outcome)

    def inspection(self, sequence: int) -> Inspection | None:
        """One of the last inspections.

        Args:
            sequence: its number.
        """
        return self._inspections.get(sequence)

    async def outcome(self, sequence: int) -> Outcome:
        """Wait for an outcome.

        Args:
            sequence: of an inspection of this start of the station.

        Raises:
            UnknownInspectionError: none of the last has this number.
        """
        waiting = self._outcomes.get(sequence)
        if waiting is None:
            raise UnknownInspectionError(
                f"no inspection {sequence} has begun since this start of the station", "ask what is open with Resume"
            )
        return await asyncio.shield(waiting)


class Pending:
    """One trigger between its request and its answer."""

    def __init__(self, request: Begin, inspection: Inspection) -> None:
        self.request, self.inspection = request, inspection
        self.recording: asyncio.Future[int] | None = None
        """Makes it durable; where it is cancelled, the record is taken back."""
        self._answer: asyncio.Future[BeginReply] = asyncio.get_running_loop().create_future()

    @property
    def is_answered(self) -> bool:
        """Whether the request has its answer."""
        return self._answer.done()

    def answer(self, begun: BeginReply) -> None:
        """Answer the request; the first answer stands.

        Args:
            begun: accepted or refused.
        """
        if not self.is_answered:
            self._answer.set_result(begun)

    async def answered(self) -> BeginReply:
        """Wait for the answer."""
        return await asyncio.shield(self._answer)
