"""Error mapping: errors of SQLite and the operating system to the records' own."""

import errno
import sqlite3

from sqlalchemy.exc import DBAPIError, StatementError

from station.messages import records as messages
from station.messages.message import Definition
from station.records.errors import (
    BadRecordError,
    DamagedError,
    DiskError,
    DiskFullError,
    LockedError,
    ReadOnlyError,
    RecordsError,
)

Mapped = tuple[type[RecordsError], Definition, Definition]
"""Kind, cause with place and text, and remedy."""

_FULL: Mapped = (DiskFullError, messages.DISK_FULL, messages.FREE_SPACE_OR_QUOTA)
_READ_ONLY: Mapped = (ReadOnlyError, messages.NOT_WRITABLE, messages.MAKE_WRITABLE)
_LOCKED: Mapped = (LockedError, messages.LOCKED, messages.CLOSE_PROGRAM)
_DISK: Mapped = (DiskError, messages.DISK_FAILED, messages.REPLACE_DISK)
_NO_FOLDER: Mapped = (RecordsError, messages.FILE_OR_FOLDER, messages.MOVE_AWAY)
_REFUSED: Mapped = (RecordsError, messages.REFUSED, messages.SEE_LOG)

_SQLITE: dict[int, Mapped] = {
    sqlite3.SQLITE_FULL: _FULL,
    sqlite3.SQLITE_READONLY: _READ_ONLY,
    sqlite3.SQLITE_PERM: _READ_ONLY,
    sqlite3.SQLITE_CANTOPEN: _READ_ONLY,
    sqlite3.SQLITE_BUSY: _LOCKED,
    sqlite3.SQLITE_LOCKED: _LOCKED,
    sqlite3.SQLITE_CORRUPT: (DamagedError, messages.DAMAGED, messages.OPEN_AGAIN),
    sqlite3.SQLITE_NOTADB: (DamagedError, messages.NO_DATABASE, messages.OPEN_AGAIN),
    sqlite3.SQLITE_IOERR: _DISK,
}
"""By SQLite's primary result code (sqlite.org/rescode.html): the lowest 8 bits."""

_SYSTEM: dict[int, Mapped] = {
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EFBIG: _FULL,
    errno.EROFS: _READ_ONLY,
    errno.EACCES: _READ_ONLY,
    errno.EPERM: _READ_ONLY,
    errno.EEXIST: _NO_FOLDER,
    errno.ENOTDIR: _NO_FOLDER,
    errno.EISDIR: _NO_FOLDER,
}


def map_error(error: Exception, place: str) -> RecordsError:
    """Convert what SQLAlchemy, sqlite3 or the operating system raised for a file to a `RecordsError`."""
    if isinstance(error, RecordsError):
        return error
    said = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    if isinstance(said, sqlite3.Error):
        code = getattr(said, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
        kind, cause, remedy = _SQLITE.get(code, _REFUSED)
        return kind(cause(place=place, words=str(said)), remedy())
    if isinstance(said, OSError):
        kind, cause, remedy = _SYSTEM.get(said.errno or 0, _DISK)
        return kind(cause(place=place, words=said.strerror or str(said)), remedy())
    if isinstance(said, (StatementError, ValueError, TypeError)):
        return BadRecordError(messages.MALFORMED(words=str(said)), messages.REPORT_FAULT())
    unexpected = messages.UNEXPECTED(place=place, kind=type(said).__name__, words=str(said))
    return RecordsError(unexpected, messages.SEE_LOG())
