"""Opening of a records folder, in any state after a crash or damage."""

import fcntl
import logging
import os
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError
from sqlalchemy import Connection, func, select

from station.atomic_file import sync_folder, write_atomically
from station.messages import records as messages
from station.messages.message import Definition, Message
from station.records.audit import continue_audit, newer_head, note_unsigned
from station.records.audit_head import Head, read_head, try_save_head
from station.records.database import FILE_NAME, check, move_aside, new_aside, open_engine
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, LockedError, SequenceError
from station.records.high_water_mark import MARK_NAME, HighWaterMark
from station.records.images import FOLDER_NAME, ImageStore
from station.records.migration import migrate
from station.records.schema import inspections
from station.records.seals import begin_seals
from station.records.signing import name_of, own_public_key
from station.records.write_requests import add_event, end_open_inspections
from station.records.writer import Writer
from station.settings.records import RecordsSettings

LOCK_NAME = "lock"
NOTICE_NAME = "notice.json"
"""File of the notice of lost records, from before anything is moved aside until its alarm is stored: neither a failed
opening nor an end of the process forgets it."""

RESTORING = "restoring"
"""Folder of a restore's copy until it takes the records' place."""

BELONGING = (FOLDER_NAME, f"{FILE_NAME}-wal", f"{FILE_NAME}-shm", FILE_NAME)
"""Files that are moved aside together. The database goes last: while it exists the next start continues the move, and a
new one never meets an old one's write-ahead log or takes its images for orphans."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Notice:
    """A finding at the opening of the records that needs a person: the caller raises an alarm."""

    code: str
    """The code of the corresponding `RecordsError`, as `damaged`."""
    cause: Message
    remedy: Message
    aside: str
    """Folder of what was moved aside."""


_NOTICE = TypeAdapter(Notice)


@dataclass(frozen=True, slots=True)
class Opened:
    """Open records."""

    writer: Writer
    images: ImageStore
    mark: HighWaterMark
    notices: tuple[Notice, ...]
    lost: tuple[int, ...]
    """The inspections that an earlier start left open."""


def lock_folder(folder: Path) -> int:
    """Make the folder if it is missing, and lock it against other stations; closing the descriptor releases the lock.

    Raises:
        LockedError: another station has it.
        RecordsError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise map_error(error, str(folder)) from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.ftruncate(descriptor, 0)
        os.write(descriptor, str(os.getpid()).encode())
    except BlockingIOError as error:
        holder = os.read(descriptor, 20).decode("ascii", "replace") or "unknown"
        os.close(descriptor)
        raise LockedError(
            messages.ANOTHER_STATION(folder=str(folder), process=holder), messages.STOP_OTHER()
        ) from error
    except OSError as error:
        os.close(descriptor)
        raise map_error(error, str(folder)) from error
    return descriptor


def open_records(folder: Path, settings: RecordsSettings, boot: str, failures: Counter[str]) -> Opened:
    """Open the records for this start of the station, `boot`; the folder is locked by the caller. Blocks.

    Args:
        failures: counts the requests that failed, by the code of their error.

    Raises:
        RecordsError: they cannot be opened.
    """
    path = folder / FILE_NAME
    shutil.rmtree(folder / RESTORING, ignore_errors=True)  # of a restore that was killed: its backup still exists
    try:
        mark = HighWaterMark(folder / MARK_NAME)
        notices = _move_damaged_aside(folder, mark)
        migrate(open_engine(path, "rwc"), folder)
        sync_folder(folder)
        writer = Writer(*_connector(path, mark), str(path), failures)
        try:
            head, public_key = read_head(folder), name_of(own_public_key(folder))
            lost = writer.submit(
                lambda connection: _first_transaction(connection, mark, head, public_key, boot, notices)
            ).result()
            images = ImageStore(folder, settings, writer.submit)
        except BaseException:
            writer.close()
            raise
    except OSError as error:
        raise map_error(error, str(folder)) from error
    return Opened(writer, images, mark, notices, lost)


def _move_damaged_aside(folder: Path, mark: HighWaterMark) -> tuple[Notice, ...]:
    """Move a damaged database aside, and what a missing one left, if the numbers can continue without it.

    Returns:
        The notice of it, or of an earlier loss whose alarm is not stored yet.
    """
    path, pending = folder / FILE_NAME, _pending(folder)
    if not path.exists() or not path.stat().st_size:
        if mark.value:
            path.unlink(missing_ok=True)  # an opening that failed may have begun it, once more with each attempt
            cause = messages.MISSING_DATABASE(path=str(path), number=mark.value)
            return (_move_aside(folder, pending, DamagedError.code, cause, messages.FIND_OLD),)
        if was_used(folder, mark):
            raise _lost_mark(mark)
        return ()
    try:
        check(path)
    except DamagedError as error:
        if not mark.known:
            raise _lost_mark(mark) from error
        cause = messages.BEGUN_ANEW(cause=error.cause, number=mark.value)
        return (_move_aside(folder, pending, error.code, cause, messages.RECOVER_OLD),)
    return () if pending is None else (pending,)


def _move_aside(folder: Path, pending: Notice | None, code: str, cause: Message, remedy: Definition) -> Notice:
    """Continue the move of a pending notice, or begin another one, whose notice is durable first."""
    notice = pending
    if notice is None or any((folder / name).exists() and Path(notice.aside, name).exists() for name in BELONGING):
        aside = str(new_aside(folder))
        notice = Notice(code, cause, remedy(folder=aside), aside)
        write_atomically(folder / NOTICE_NAME, _NOTICE.dump_json(notice))
        log.error("%s; what is left is moved to %s", cause, aside)
    move_aside(folder, Path(notice.aside), *BELONGING)
    return notice


def _pending(folder: Path) -> Notice | None:
    try:
        return _NOTICE.validate_json((folder / NOTICE_NAME).read_bytes())
    except FileNotFoundError:
        return None
    except ValidationError:
        log.exception("%s is unreadable: no alarm is raised of it", folder / NOTICE_NAME)
        return None


def was_used(folder: Path, mark: HighWaterMark) -> bool:
    """Check whether a folder without a database has had one: its mark, images or what was moved aside show it."""
    return mark.value > 0 or (not mark.known and any((folder / name).exists() for name in ("aside", FOLDER_NAME)))


def _lost_mark(mark: HighWaterMark) -> SequenceError:
    return SequenceError(messages.NUMBERS_UNKNOWN(path=str(mark.path)), messages.CONTINUE_AFTER())


def _connector(
    path: Path, mark: HighWaterMark
) -> tuple[Callable[[], Connection], Callable[[Connection], None], Callable[[], None]]:
    """Return how the writer connects, and what it does before and after each commit."""
    engine = open_engine(path, "rw")
    found = path.stat()
    saved = mark.value if mark.known else 0
    head = read_head(path.parent)
    ahead: Head | None = None

    def confirm() -> None:
        """Check that the file still exists: one that was removed could be written for ever, and would be lost."""
        now = path.stat() if path.exists() else None
        if now is None or (now.st_dev, now.st_ino) != (found.st_dev, found.st_ino):
            raise DamagedError(messages.REMOVED(path=str(path)), messages.OPEN_AGAIN())

    def connect() -> Connection:
        confirm()
        return engine.connect()

    def before_commit(connection: Connection) -> None:
        nonlocal saved, ahead
        # Before the commit: a number that the file alone has is skipped; one that the database alone has would be given
        # again if that database were lost.
        if mark.value != saved:
            mark.save()
            saved = mark.value
        ahead = newer_head(connection, head)
        confirm()

    def after_commit() -> None:
        nonlocal head
        if ahead is not None:
            try_save_head(path.parent, ahead)
            head = ahead

    return connect, before_commit, after_commit


def _first_transaction(
    connection: Connection,
    mark: HighWaterMark,
    head: Head | None,
    public_key: str,
    boot: str,
    notices: tuple[Notice, ...],
) -> tuple[int, ...]:
    """Run the first transaction of a start."""
    mark.value = max(mark.value, connection.scalar(select(func.max(inspections.c.sequence))) or 0)
    if continue_audit(connection, head) is None:
        note_unsigned(connection, head)
    begin_seals(connection, mark.value, public_key)
    lost = end_open_inspections(connection)
    add_event(connection, "opened", None, {"boot": boot, "station_lost": lost})
    for notice in notices:
        details = {"cause": str(notice.cause), "remedy": str(notice.remedy)}
        add_event(connection, f"notice_{notice.code}", None, details)
    return tuple(lost)


def set_mark(folder: Path, number: int) -> None:
    """Set the high-water mark to the highest sequence number ever given, while no station has the folder.

    Raises:
        SequenceError: a higher one was given.
        RecordsError: the folder is in use or cannot be written.
    """
    lock = lock_folder(folder)
    try:
        mark = HighWaterMark(folder / MARK_NAME)
        if number < mark.value:
            raise SequenceError(messages.NUMBER_GIVEN(number=mark.value), messages.GIVE_HIGHER(number=mark.value))
        mark.value = number
        mark.save()
    except OSError as error:
        raise map_error(error, str(folder)) from error
    finally:
        os.close(lock)
