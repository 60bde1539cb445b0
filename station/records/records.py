"""Records of the station: asynchronous calls, each with a deadline, on top of one writer thread."""

import asyncio
import contextlib
import logging
import os
import shutil
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeVar

from sqlalchemy import Connection

from station.channel.line import Outcome
from station.messages import records as messages
from station.messages.message import Message
from station.records.audit import AuditEntry, AuditRow, append_audit
from station.records.database import FILE_NAME, check
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, DiskFullError, RecordsClosedError, RecordsDeadlineError, RecordsError
from station.records.images import MB, accepted_is_stored
from station.records.model import AlarmEntry, InspectionRecord, OpenInspections, StoredAlarm, Trigger
from station.records.open import NOTICE_NAME, Notice, Opened, lock_folder, open_records
from station.records.queries import read_alarms, read_open
from station.records.write_requests import (
    acknowledge,
    begin_again,
    conclude,
    insert_trigger,
    publish,
    replace_alarms,
    withdraw,
)
from station.records.writer import Work
from station.settings.records import RecordsSettings

T = TypeVar("T")

log = logging.getLogger(__name__)

DAMAGE_S = 0.5
"""Longest search for damage while the station runs: some 500 MB of a database."""
IMAGES_CLOSE_S = 5.0
"""Longest wait for images when the records are closed."""


@dataclass(frozen=True, slots=True)
class Status:
    """State of the records, for metrics and readiness."""

    writes: int
    """Transactions that were committed."""
    failures: dict[str, int]
    """Requests and openings that failed since the start, by the code of their error."""
    queue: int
    """Requests that wait for the writer."""
    images_waiting: int
    """Inspections whose images are not yet on the disk."""
    images: dict[str, int]
    """Images since the start: `kept`, `dropped`, `failed`, `removed`, `over_quota`."""
    database_bytes: int
    image_bytes: int
    free_bytes: int
    last_write_age_s: float | None
    """By the monotonic clock; None before the first."""
    error: Message | None
    """Error of the last write; None if it succeeded."""


class Records:
    """One station's records. Make them with `open`."""

    def __init__(self, folder: Path, settings: RecordsSettings, boot: str) -> None:
        self.folder = folder
        self._files = (folder / FILE_NAME, folder / f"{FILE_NAME}-wal")
        self.notices: tuple[Notice, ...] = ()
        """Findings of the last `open` or `reopen`, and of earlier ones until `forget_notices`."""
        self.lost: tuple[int, ...] = ()
        """The inspections that it ended with `station_lost`."""
        self._settings = settings
        self._boot = boot
        self._failures: Counter[str] = Counter()
        """Of all openings: a fault is followed by the next one."""
        self._opened: Opened | None = None
        self._why_closed: RecordsError = RecordsClosedError(messages.CLOSED(), messages.OPEN_FIRST())
        self._lock: int | None = None
        self._helper = ThreadPoolExecutor(1, "records-helper")

    @classmethod
    async def open(cls, folder: Path, settings: RecordsSettings, boot: str) -> Self:
        """Open the records of a station, or make them.

        Migrates the schema, moves a damaged database aside, and ends the open inspections of an earlier start of the
        station: one that was running, or whose outcome was never published, becomes NO_RESULT with `station_lost`.

        Args:
            folder: made if missing; one station at a time.
            boot: name of this start of the station, as in `StationState.boot`.

        Raises:
            RecordsError: they cannot be opened.
        """
        records = cls(folder, settings, boot)
        try:
            await records.reopen()
        except BaseException:
            await records.close()
            raise
        return records

    async def reopen(self) -> None:
        """Close and open the records again, after a fault of the disk; not while an inspection runs.

        Raises:
            RecordsError: they still cannot be opened; every request is refused with that error until they can.
        """
        await asyncio.get_running_loop().run_in_executor(self._helper, self._reopen)

    def _reopen(self) -> None:
        self._shut()
        self.notices = ()
        try:
            if self._lock is None:
                self._lock = lock_folder(self.folder)
            self._opened = open_records(self.folder, self._settings, self._boot, self._failures)
        except RecordsError as error:
            self._failures[error.code] += 1
            self._why_closed = error
            raise
        self.notices, self.lost = self._opened.notices, self._opened.lost

    async def forget_notices(self) -> None:
        """Forget the notices, because their alarm is stored; until then each opening has them again."""

        def forget() -> None:
            try:
                (self.folder / NOTICE_NAME).unlink(missing_ok=True)
            except OSError as error:
                log.warning("the next start raises the alarm of lost records again: %s", error)
            self.notices = ()

        await asyncio.get_running_loop().run_in_executor(self._helper, forget)

    def _shut(self) -> None:
        if self._opened is not None:
            self._opened.images.close(IMAGES_CLOSE_S)
            self._opened.writer.close()
        self._opened = None

    async def close(self) -> None:
        """Finish the queue, images for `IMAGES_CLOSE_S` at most, and end the threads. Idempotent."""
        self._why_closed = RecordsClosedError(messages.CLOSED(), messages.OPEN_FIRST())
        with contextlib.suppress(RuntimeError):  # the helper has ended
            await asyncio.get_running_loop().run_in_executor(self._helper, self._shut)
        self._helper.shutdown()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    async def find_damage(self) -> None:
        """Check for damage while the station runs: a page that is not read would be noticed much later.

        Raises:
            RecordsError: the database is damaged, removed or cannot be read.
        """
        self._get()
        path = self.folder / FILE_NAME

        def find() -> None:
            try:
                path.stat()
            except FileNotFoundError:
                raise DamagedError(messages.REMOVED(path=str(path)), messages.OPEN_AGAIN()) from None
            except OSError as error:
                raise map_error(error, str(path)) from error
            check(path, DAMAGE_S)

        await asyncio.get_running_loop().run_in_executor(self._helper, find)

    async def begin(self, trigger: Trigger) -> int:
        """Make a trigger durable and number it. Not idempotent: each call begins another inspection.

        Returns:
            The sequence, higher than any given before, by any database in this folder.

        Raises:
            RecordsError: nothing was started, or it was withdrawn.
        """
        opened = self._get()

        def work(connection: Connection) -> int:
            free_mb = shutil.disk_usage(self.folder).free // MB
            if free_mb < self._settings.free_reserve_mb:
                raise DiskFullError(
                    messages.RESERVE_REACHED(
                        free_mb=free_mb, folder=str(self.folder), reserve_mb=self._settings.free_reserve_mb
                    ),
                    messages.FREE_SPACE_OR_QUOTA(),
                )
            sequence = opened.mark.next()
            insert_trigger(connection, sequence, trigger, self._boot)
            return sequence

        def withdraw_late(future: Future[int]) -> None:
            if not future.cancelled() and future.exception() is None:
                opened.writer.submit(lambda connection: withdraw(connection, future.result()))

        future = opened.writer.submit(work)
        try:
            return await self._answer(future)
        except BaseException:  # the caller has gone, or will refuse the trigger
            future.add_done_callback(withdraw_late)
            raise

    async def conclude(self, sequence: int, record: InspectionRecord, begun: Trigger | None = None) -> Outcome:
        """Make an outcome durable. The first one remains: a repetition changes nothing.

        Images are written afterwards in the background, or dropped and reported.

        Args:
            begun: its trigger, recorded again where the database in which it began was moved aside meanwhile.

        Returns:
            The outcome in force: this record's, or the one that was published or concluded before.

        Raises:
            UnknownInspectionError: no inspection has this sequence.
            RecordsError: it may not be durable; the PLC must not see a result of it.
        """
        opened = self._get()
        wanted = bool(record.images) and self._settings.images_quota_mb > 0
        # Before the commit: the row says already whether images follow.
        reserved = wanted and opened.images.reserve()
        not_wanted = messages.IMAGES_NOT_WANTED()
        dropped = messages.IMAGES_DROPPED(cause=messages.TOO_MANY_WAIT())
        state = messages.IMAGES_PENDING() if reserved else dropped if wanted else not_wanted
        accepted = state if accepted_is_stored(sequence, self._settings.accepted_share) else not_wanted

        def work(connection: Connection) -> tuple[Outcome, Message | None]:
            if begun is not None and sequence <= opened.mark.value:
                begin_again(connection, sequence, begun, self._boot)
            return conclude(connection, sequence, record, {"PASS": accepted, "other": state})

        future = opened.writer.submit(work)
        # Not after the wait: a commit that outlasts the deadline gets its images too.
        future.add_done_callback(lambda done: self._hand_over(opened, done, sequence, record, reserved=reserved))
        outcome, _ = await self._answer(future)
        return outcome

    def _hand_over(
        self,
        opened: Opened,
        done: Future[tuple[Outcome, Message | None]],
        sequence: int,
        record: InspectionRecord,
        *,
        reserved: bool,
    ) -> None:
        """Queue an inspection's images once its outcome is durable."""
        failed = done.cancelled() or done.exception() is not None
        state = None if failed else done.result()[1]
        if state == messages.IMAGES_PENDING():
            accepted = record.outcome == done.result()[0].outcome == "PASS"
            opened.images.put(sequence, record.images, accepted=accepted)
            return
        if state is not None and state.id == messages.IMAGES_DROPPED.id:
            opened.images.drop(len(record.images))
        if reserved:
            opened.images.release()

    async def published(self, outcome: Outcome) -> bool:
        """Store that the PLC was given an outcome; it overrides the judgement. The first one remains: idempotent.

        An inspection that this database does not know, as one started before a damaged database was moved aside, is
        recorded from the outcome itself. True for the first time, so that it is counted once: without a deadline, as
        the answer to a slow write would be lost, and that to its repetition is False.

        Raises:
            UnknownInspectionError: no such sequence was ever given.
            RecordsError: it may not be durable.
        """
        mark = self._get().mark
        return await self.change_to_end(lambda connection: publish(connection, outcome, mark.value, self._boot))

    async def acknowledged(self, sequence: int) -> int:
        """Store that the PLC has taken every outcome up to this sequence, and count the new ones. Idempotent.

        Raises:
            RecordsError: it may not be durable.
        """
        return await self._ask(lambda connection: acknowledge(connection, sequence))

    async def open_inspections(self) -> OpenInspections:
        """Return the inspections that began and were not acknowledged."""
        return await self._ask(read_open)

    async def save_alarms(self, active: Sequence[StoredAlarm], log: Sequence[AlarmEntry] = ()) -> None:
        """Replace the stored alarms and append to their log in one transaction, without a deadline."""
        await self.change_to_end(lambda connection: replace_alarms(connection, active, log))

    async def load_alarms(self) -> tuple[StoredAlarm, ...]:
        """Return the alarms that were saved last."""
        return await self._ask(read_alarms)

    async def audit(self, *entries: AuditEntry) -> tuple[AuditRow, ...]:
        """Append to the audit trail in one transaction, without a deadline.

        Raises:
            BadRecordError: an entry is malformed.
            RecordsError: it may not be durable.
        """
        return await self.change_to_end(lambda connection: tuple(append_audit(connection, entry) for entry in entries))

    async def change(self, work: Work[T]) -> T:
        """Change lots or holds in the writer's thread, as `lambda connection: end_lot(connection, name, by)`.

        Raises:
            RecordsError: it may not be durable.
        """
        return await self._ask(work)

    async def change_to_end(self, work: Work[T]) -> T:
        """As `change`, with no deadline: the answer is what the records have, however long the disk takes."""
        return await asyncio.wrap_future(self._get().writer.submit(work))

    def status(self) -> Status:
        """Return the state of the records; never waits."""
        opened = self._opened
        free_bytes = 0
        with contextlib.suppress(OSError):
            free_bytes = shutil.disk_usage(self.folder).free
        written_s = opened.writer.last_write_s if opened else None
        return Status(
            writes=opened.writer.writes if opened else 0,
            failures=dict(self._failures),
            queue=opened.writer.waiting if opened else 0,
            images_waiting=opened.images.waiting if opened else 0,
            images=dict(opened.images.results) if opened else {},
            database_bytes=sum(map(_size_bytes, self._files)),
            image_bytes=opened.images.size_bytes if opened else 0,
            free_bytes=free_bytes,
            last_write_age_s=None if written_s is None else time.monotonic() - written_s,
            error=opened.writer.error if opened else self._why_closed.message,
        )

    def _get(self) -> Opened:
        opened = self._opened
        if opened is None:
            raise self._why_closed.again()
        return opened

    async def _ask(self, work: Work[T]) -> T:
        return await self._answer(self._get().writer.submit(work))

    async def _answer(self, future: Future[T]) -> T:
        deadline_s = self._settings.deadline_s
        try:
            async with asyncio.timeout(deadline_s):
                return await asyncio.wrap_future(future)
        except TimeoutError:
            self._failures[RecordsDeadlineError.code] += 1
            raise RecordsDeadlineError(messages.TOO_SLOW(limit_s=deadline_s), messages.CHECK_DISK()) from None


def _size_bytes(file: Path) -> int:
    """Return a file's size; 0 for none, and for one that cannot be read: SQLite removes its log at any time."""
    with contextlib.suppress(OSError):
        return file.stat().st_size
    return 0
