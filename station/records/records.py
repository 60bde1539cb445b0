"""The records' door: asynchronous, each call with a deadline; below it one thread writes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from station.channel.line import Outcome
from station.records.model import AlarmEntry, AlarmRow, FullRecord, InspectionRecord, OpenInspections, Trigger
from station.settings.records import RecordsSettings


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that opening the records found and a person has to know: the caller raises an alarm of it."""

    code: str
    """The code of the `RecordsError` that it would have been, as `damaged`."""
    cause: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Status:
    """How the records do, for metrics and readiness."""

    writes: int
    """Transactions that were committed."""
    failures: dict[str, int]
    """Requests that failed, by the code of their error."""
    queue: int
    """Requests that wait for the writer."""
    images_waiting: int
    """Inspections whose images are not yet on the disk."""
    images: dict[str, int]
    """Images since the start: `kept`, `dropped`, `failed`, `removed`."""
    database_bytes: int
    image_bytes: int
    free_bytes: int
    last_write_age_s: float | None
    """By the monotonic clock; None before the first."""
    error: str
    """Of the last write, where it failed; empty where it went well."""


class Records:
    """One station's records."""

    notices: tuple[Notice, ...]
    """What the last `open` or `reopen` found."""

    @classmethod
    async def open(cls, folder: Path, settings: RecordsSettings, boot: str) -> Self:
        """Open the records of a station, or begin them.

        Brings the schema up to date, moves a damaged database aside, and ends what an earlier start of the station
        left open: an inspection that was running, or whose outcome was never published, becomes NO_RESULT with
        `station_lost`.

        Args:
            folder: made where missing; one station at a time.
            settings: the quota, the reserve, the deadline.
            boot: this start of the station, as in `StationState.boot`.

        Raises:
            RecordsError: they cannot be opened; nothing was changed.
        """
        raise NotImplementedError

    async def reopen(self) -> None:
        """Close what is open and open it again, after a fault of the disk; not while an inspection runs.

        Raises:
            RecordsError: they still cannot be opened; every request is refused with that error until they can.
        """
        raise NotImplementedError

    async def close(self) -> None:
        """Finish what waits, within the deadline, and end the threads. Idempotent."""
        raise NotImplementedError

    async def begin(self, trigger: Trigger) -> int:
        """Make a trigger durable and number it. Not idempotent: each call begins another inspection.

        Returns:
            The sequence, higher than any given before, by any database in this folder.

        Raises:
            RecordsError: nothing was begun.
        """
        raise NotImplementedError

    async def conclude(self, sequence: int, record: InspectionRecord) -> Outcome:
        """Make an outcome durable. The first one stands: a repetition changes nothing.

        Images are written afterwards in the background, and dropped and said so where that cannot be done.

        Returns:
            What stands: this record's outcome, or the one that was published or concluded before.

        Raises:
            UnknownInspectionError: this sequence was not begun.
            RecordsError: it may not be durable; the PLC must not see a result of it.
        """
        raise NotImplementedError

    async def published(self, outcome: Outcome) -> bool:
        """Note what the PLC was told; it stands, also against what was judged. The first one stands: idempotent.

        An inspection that this database does not know, as one begun before a damaged database was moved aside, is
        recorded from the outcome itself.

        Returns:
            Whether it is the first time, so that it is counted once.

        Raises:
            UnknownInspectionError: no such sequence was ever given.
            RecordsError: it may not be durable.
        """
        raise NotImplementedError

    async def acknowledged(self, sequence: int) -> int:
        """Note that the PLC has taken every published outcome up to this sequence. Idempotent.

        Returns:
            How many were newly acknowledged.

        Raises:
            RecordsError: it may not be durable.
        """
        raise NotImplementedError

    async def open_inspections(self) -> OpenInspections:
        """What was begun and not acknowledged."""
        raise NotImplementedError

    async def inspection(self, sequence: int) -> FullRecord:
        """All that is known of one inspection.

        Raises:
            UnknownInspectionError: there is no record of it.
        """
        raise NotImplementedError

    async def save_alarms(self, active: Sequence[AlarmRow], log: Sequence[AlarmEntry] = ()) -> None:
        """Replace the remembered alarms and append to their log, in one transaction."""
        raise NotImplementedError

    async def load_alarms(self) -> tuple[AlarmRow, ...]:
        """The alarms that were saved last."""
        raise NotImplementedError

    async def count(self, **by: int) -> dict[str, int]:
        """Add to counters that outlive restarts and give all of them."""
        raise NotImplementedError

    async def note_event(self, name: str, sequence: int | None = None, **details: float | str | bool | None) -> None:
        """Append to the events, with the time."""
        raise NotImplementedError

    def status(self) -> Status:
        """How the records do; never waits."""
        raise NotImplementedError
