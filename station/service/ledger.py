"""Every trigger's record: begun before it is accepted, concluded before its outcome is told, none left open."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace

from station.channel.line import Open, Outcome
from station.inspection.cycle import Event
from station.logs import inspecting
from station.records.errors import RecordsError
from station.records.records import Records
from station.service.crew import Crew
from station.service.fruit_line import fruit_line
from station.service.inspection import Inspection
from station.service.triggers import Pending, Triggers
from station.vocabulary import Reason

log = logging.getLogger(__name__)


class Ledger:
    """What the records hold of this start's inspections.

    Args:
        records: opened, or to be opened again once `fault` is mended.
        triggers: those who wait for outcomes.
        crew: whose names stand in the records.
        versions: of the programs, likewise.
    """

    def __init__(self, records: Records, triggers: Triggers, crew: Crew, versions: Mapping[str, str]) -> None:
        self.records = records
        self.fault: RecordsError | None = None
        """Why the records are not to be relied on, until they were opened again."""
        self.on_told: Callable[[Inspection], None] = lambda _: None
        """Told of every inspection with its durable outcome."""
        self._triggers, self._crew, self._versions = triggers, crew, versions
        self._begun: list[Inspection] = []
        """Accepted, in order, and perhaps without a durable outcome."""
        self._closing = asyncio.Lock()

    @property
    def running(self) -> Inspection | None:
        """The first inspection without a durable outcome, if there is one."""
        return next((now for now in self._begun if now.standing is None), None)

    async def begin(self, pending: Pending) -> None:
        """Make a trigger durable.

        Args:
            pending: it is given its record's number.

        Raises:
            RecordsError: it could not be.
        """
        pending.recording = asyncio.ensure_future(self.records.begin(pending.inspection.trigger))
        try:
            pending.inspection.sequence = await pending.recording
        except RecordsError as error:
            self.fault = error
            raise

    def accepted(self, now: Inspection) -> None:
        """An inspection needs an outcome from now on.

        Args:
            now: with its number.
        """
        self._begun = [known for known in self._begun if known.standing is None]
        self._begun.append(now)

    async def conclude(self, now: Inspection) -> Event:
        """Make an inspection's outcome durable; the one that the records hold already stands.

        Args:
            now: with its number.

        Raises:
            RecordsError: it could not be.
        """
        if now.sequence is None:
            raise RuntimeError("an inspection without a number is recorded")
        devices = {**self._crew.names, "calibration": now.calibration}
        signed = replace(now.record(), devices=devices, versions=self._versions)
        try:
            now.standing = await self.records.conclude(now.sequence, signed)
        except RecordsError as error:
            self.fault = error
            raise
        return Event.RECORDED

    def tell(self, now: Inspection) -> None:
        """Give a durable outcome to who waits for it.

        Args:
            now: nothing is told of one that has none.
        """
        if now.standing is not None:
            self._triggers.ended(now.standing)
            self.on_told(now)
            areas = [seen.contact.area_px * now.mm_per_px**2 for seen in now.seen]
            with inspecting(now.standing.sequence):
                log.info(fruit_line(now.standing, now.active.recipe.name, now.record().explanation, areas))

    async def close_unfinished(self) -> Event:
        """Give NO_RESULT to every inspection that has no durable outcome.

        Raises:
            RecordsError: not yet.
        """
        async with self._closing:
            while (now := self.running) is not None:
                now.outcome_name = "NO_RESULT"
                if not now.interruptions:
                    now.interrupt(Reason.RECORDS_FAULT, "the outcome could not be made durable in time")
                await self.conclude(now)
                self.tell(now)
        return Event.UNFINISHED_CLOSED

    async def outcome(self, sequence: int) -> Outcome:
        """Wait for an inspection's outcome; of an earlier start of the station it is there at once.

        Args:
            sequence: its number.
        """
        if self._triggers.inspection(sequence) is None:
            for outcome in (await self.records.open_inspections()).ended:
                if outcome.sequence == sequence:
                    return outcome
        return await self._triggers.outcome(sequence)

    async def open(self) -> Open:
        """What was begun and not acknowledged."""
        held, now = await self.records.open_inspections(), self.running
        running = None if now is None or now.sequence is None else (now.sequence, now.trigger.trigger_id)
        return Open(running=running, outcomes=held.ended)
