"""Inspection registry: stores every trigger before it is accepted and every outcome before it is published."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace

from station.channel.line import Open, Outcome
from station.inspection.cycle import Event
from station.logs import inspecting
from station.messages import operation as messages
from station.records.errors import RecordsError
from station.records.records import Records
from station.runtime.cycle.inspection import Inspection
from station.runtime.cycle.recent_triggers import PendingTrigger, RecentTriggers
from station.runtime.devices.manager import DeviceManager
from station.runtime.observability.log_line import log_fruit
from station.vocabulary import Reason

log = logging.getLogger(__name__)


class InspectionRegistry:
    """Records of this start's inspections, with the devices' and programs' names; none is left without an outcome."""

    def __init__(
        self, records: Records, triggers: RecentTriggers, devices: DeviceManager, versions: Mapping[str, str]
    ) -> None:
        self.records = records
        self.fault: RecordsError | None = None
        """Of the records, until they were reopened."""
        self._restore: Callable[[], Awaitable[None]] | None = None
        self._on_outcome: Callable[[Inspection], None] = lambda _: None
        self._triggers, self._devices, self._versions = triggers, devices, versions
        self._begun: list[Inspection] = []
        """Accepted, in order, and perhaps without a durable outcome."""
        self._closing = asyncio.Lock()

    def listen(self, on_outcome: Callable[[Inspection], None]) -> None:
        """Call a function, in place of the one before, with every inspection once its outcome is durable."""
        self._on_outcome = on_outcome

    async def reopen(self, restore: Callable[[], Awaitable[None]] | None = None, reserve_bytes: int = 0) -> None:
        """Open the records, again after a fault, which ends once they can be used and `reserve_bytes` are free.

        Args:
            restore: reads what another part needs of them; tried again with each opening until it has succeeded.
        """
        self._restore = restore or self._restore
        try:
            await self.records.reopen()
            if self._restore is not None:
                await self._restore()
            self._restore = None
        except RecordsError as error:
            self.fault = error
        else:
            if self.records.status().free_bytes >= reserve_bytes:
                self.fault = None

    async def find_damage(self) -> RecordsError | None:
        """Check the records for damage, which is a fault from then on."""
        try:
            await self.records.find_damage()
        except RecordsError as error:
            self.fault = error
            return error
        return None

    @property
    def running_sequence(self) -> int | None:
        """Of the inspection under way; None for none, and before its trigger is durable."""
        return None if self.running is None else self.running.sequence

    @property
    def running(self) -> Inspection | None:
        """Return the first inspection without a durable outcome, if any."""
        return next((now for now in self._begun if now.standing is None), None)

    async def begin(self, pending: PendingTrigger) -> None:
        """Make a trigger durable; it gets its record's number.

        Raises:
            RecordsError: the trigger could not be stored.
        """

        async def record() -> None:  # until it has set the number, the trigger can be withdrawn
            pending.inspection.sequence = await self.records.begin(pending.inspection.trigger)

        pending.recording = asyncio.ensure_future(record())
        try:
            await pending.recording
        except RecordsError as error:
            self.fault = error
            raise

    def accepted(self, now: Inspection) -> None:
        """Note that an inspection needs an outcome from now on."""
        self._begun = [known for known in self._begun if known.standing is None]
        self._begun.append(now)

    async def conclude(self, now: Inspection) -> Event:
        """Make an inspection's outcome durable; one that the records have already is not changed.

        Raises:
            RecordsError: the outcome could not be stored.
        """
        if now.sequence is None:
            raise RuntimeError("an inspection without a number is recorded")
        devices = {**self._devices.names, "calibration": now.calibration}
        signed = replace(now.record(), devices=devices, versions=self._versions)
        try:
            now.standing = await self.records.conclude(now.sequence, signed, now.trigger)
        except RecordsError as error:
            self.fault = error
            raise
        return Event.RECORDED

    def deliver(self, now: Inspection) -> None:
        """Pass a durable outcome, if there is one, to the callers that wait for it."""
        if now.standing is not None:
            self._triggers.ended(now.standing)
            self._on_outcome(now)
            areas = [seen.contact.area_px * now.mm_per_px**2 for seen in now.seen]
            with inspecting(now.standing.sequence):
                log_fruit(log, now.standing, now.active.recipe.name, now.record().explanation, areas)

    async def close_unfinished(self) -> Event:
        """Store NO_RESULT for every inspection that has no durable outcome.

        Raises:
            RecordsError: it cannot be stored now.
        """
        # A refused trigger's end and the clearing may run at the same time: each inspection is delivered once.
        async with self._closing:
            while (now := self.running) is not None:
                now.outcome_name = "NO_RESULT"
                if not now.interruptions:
                    now.interrupt(Reason.RECORDS_FAULT, messages.NOT_STORED_IN_TIME())
                await self.conclude(now)
                self.deliver(now)
        return Event.UNFINISHED_CLOSED

    async def outcome(self, sequence: int) -> Outcome:
        """Wait for an inspection's outcome; that of an earlier start is returned at once."""
        if self._triggers.inspection(sequence) is None:
            for outcome in (await self.records.open_inspections()).ended:
                if outcome.sequence == sequence:
                    return outcome
        return await self._triggers.outcome(sequence)

    async def open_inspections(self) -> Open:
        """Return the inspections that began and were not acknowledged."""
        held, now = await self.records.open_inspections(), self.running
        running = None if now is None or now.sequence is None else (now.sequence, now.trigger.trigger_id)
        return Open(running=running, outcomes=held.ended)
