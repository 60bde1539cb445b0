"""Outbox publisher: reads the next events, publishes them to each destination, and reconnects after a failure."""

import asyncio
import contextlib
import logging
import random
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Protocol

from station.clock import utc_ms
from station.errors import StationError
from station.messages import outbox as messages
from station.messages.message import Message, message_of
from station.outbox.feed import LARGEST_BATCH, Batch, read_batch
from station.outbox.mqtt import Mqtt
from station.outbox.postgresql import Postgresql
from station.outbox.status import DestinationStatus, outbox_folder, write_status
from station.records.database import records_folder
from station.records.errors import RecordsError
from station.settings.outbox import OutboxSettings

log = logging.getLogger(__name__)

FIRST_PAUSE_S = 0.5
"""First pause between two attempts to connect, s; it doubles with each. An estimate."""
LOOK_S = 0.5
"""Period of the search for new entries."""
_STATUS_S = 2.0
"""Period of the status file, s; an estimate."""


class Session(Protocol):
    """An open connection to a destination."""

    async def position(self, batch: Batch) -> int:
        """Return the last entry that the destination has."""
        ...

    async def publish(self, batch: Batch) -> None:
        """Publish a batch; it and its position are durable when this returns."""

    async def idle(self, pause_s: float) -> None:
        """Wait while there is nothing new; raises if the connection is lost."""


class Destination(Protocol):
    """A system that gets the events."""

    name: str
    refused: int

    def connected(self) -> AbstractAsyncContextManager[Session]:
        """Connect."""
        ...


class Publisher:
    """Publisher for one destination, with growing pauses between two attempts to reach it."""

    def __init__(self, folder: Path, station: str, destination: Destination, longest_pause_s: float) -> None:
        self.destination = destination
        self._folder, self._station, self._longest_pause_s = folder, station, longest_pause_s
        self._published = 0
        self._position: int | None = None
        self._waiting: int | None = None
        self._oldest_utc_ms: int | None = None
        self._connected = False
        self._error: Message | None = messages.NOT_YET_CONNECTED()
        self._away_since_utc_ms: int | None = utc_ms()

    async def run(self) -> None:
        """Publish until cancelled."""
        tries = 0
        while True:
            try:
                async with self.destination.connected() as session:
                    self._now(connected=True)
                    async for _ in self._batches(session):
                        tries = 0
            except Exception as error:
                if not isinstance(error, StationError):
                    log.exception("%s: a fault of the program", self.destination.name)
                self._now(connected=False, error=message_of(error))
            await self._count_waiting()
            pause_s = min(self._longest_pause_s, FIRST_PAUSE_S * 2**tries)
            tries = min(tries + 1, 20)
            await asyncio.sleep(pause_s * random.uniform(0.5, 1.0))  # noqa: S311 (no secret)

    def status(self) -> DestinationStatus:
        """Return the destination's status."""
        return DestinationStatus(
            connected=self._connected,
            told=self._published,
            refused=self.destination.refused,
            waiting=self._waiting,
            oldest_utc_ms=self._oldest_utc_ms,
            error=self._error,
            away_since_utc_ms=self._away_since_utc_ms,
        )

    async def _count_waiting(self) -> None:
        """Count what waits while the destination is away."""
        if self._position is not None:
            with contextlib.suppress(RecordsError):
                self._note(await self._read(self._position, 1), self._position)

    async def _batches(self, session: Session) -> AsyncIterator[Batch]:
        """Publish batch after batch until the connection is lost."""
        origin, position = "", 0
        while True:
            batch = await self._read(position, LARGEST_BATCH)
            if batch.lineage[0].id != origin:  # at the start, and after a restore
                origin, position = batch.lineage[0].id, await session.position(batch)
                continue
            self._note(batch, position)
            if batch.up_to > position:
                await session.publish(batch)
                position = batch.up_to
                self._published += len(batch.events)
                self._waiting, self._position = batch.last - position, position
            yield batch
            if batch.last == position:
                self._oldest_utc_ms = None
                await session.idle(LOOK_S)

    async def _read(self, position: int, limit: int) -> Batch:
        return await asyncio.to_thread(read_batch, self._folder, self._station, position, limit)

    def _note(self, batch: Batch, position: int) -> None:
        self._position, self._waiting = position, batch.last - position
        self._oldest_utc_ms = batch.oldest_utc_ms

    def _now(self, *, connected: bool, error: Message | None = None) -> None:
        """Log a changed state, once."""
        if connected and not self._connected:
            log.info("%s: connected", self.destination.name)
        if error and error != self._error:
            log.warning("%s: %s", self.destination.name, error)
        self._connected, self._error = connected, error
        if connected:
            self._away_since_utc_ms = None
        elif self._away_since_utc_ms is None:
            self._away_since_utc_ms = utc_ms()


def destinations(settings: OutboxSettings, home: Path) -> list[Destination]:
    """Return the enabled destinations."""
    chosen: list[Destination] = []
    if settings.postgresql.enabled:
        chosen.append(Postgresql(settings.postgresql, settings.station))
    if settings.mqtt.enabled:
        chosen.append(Mqtt(settings.mqtt, settings.station, outbox_folder(home)))
    return chosen


async def run_outbox(settings: OutboxSettings, home: Path, progress: Callable[[], None] = lambda: None) -> None:
    """Publish to every destination until cancelled, and write the status; call `progress` while everything runs."""
    folder = records_folder(home)
    chosen = destinations(settings, home)
    publishers = [Publisher(folder, settings.station, each, settings.longest_pause_s) for each in chosen]
    async with asyncio.TaskGroup() as group:
        for publisher in publishers:
            group.create_task(publisher.run(), name=f"outbox {publisher.destination.name}")
        while True:
            try:
                status = {publisher.destination.name: publisher.status() for publisher in publishers}
                await asyncio.to_thread(write_status, outbox_folder(home), status)
            except OSError as error:
                log.warning("the outbox's status cannot be written: %s", error)
            progress()
            await asyncio.sleep(_STATUS_S)
