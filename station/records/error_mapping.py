"""Error mapping: errors of SQLite and the operating system to the records' own."""

import errno
import sqlite3

from sqlalchemy.exc import DBAPIError, StatementError

from station.records.errors import (
    BadRecordError,
    DamagedError,
    DiskError,
    DiskFullError,
    LockedError,
    ReadOnlyError,
    RecordsError,
)

DAMAGED_REMEDY = "open the records again: it is moved aside, and a new one is begun with the numbers going on"

_FULL = ("the disk is full", "free space, or lower records.images_quota_mb")
_READ_ONLY = ("cannot be written", "make the folder and its files writable for the station's user, and the disk too")
_LOCKED = ("another program holds the database", "close what has it open for writing")
_DISK = ("the disk failed", "look at the system's log, and replace the disk if it says so")

_NO_FOLDER = ("a file is where a folder has to be, or a folder where a file", "move it away, or set another home")

_SQLITE: dict[int, tuple[type[RecordsError], tuple[str, str]]] = {
    sqlite3.SQLITE_FULL: (DiskFullError, _FULL),
    sqlite3.SQLITE_READONLY: (ReadOnlyError, _READ_ONLY),
    sqlite3.SQLITE_PERM: (ReadOnlyError, _READ_ONLY),
    sqlite3.SQLITE_CANTOPEN: (ReadOnlyError, _READ_ONLY),
    sqlite3.SQLITE_BUSY: (LockedError, _LOCKED),
    sqlite3.SQLITE_LOCKED: (LockedError, _LOCKED),
    sqlite3.SQLITE_CORRUPT: (DamagedError, ("the database is damaged", DAMAGED_REMEDY)),
    sqlite3.SQLITE_NOTADB: (DamagedError, ("the database is none", DAMAGED_REMEDY)),
    sqlite3.SQLITE_IOERR: (DiskError, _DISK),
}
"""By SQLite's primary result code (sqlite.org/rescode.html): the lowest 8 bits."""

_SYSTEM: dict[int, tuple[type[RecordsError], tuple[str, str]]] = {
    errno.ENOSPC: (DiskFullError, _FULL),
    errno.EDQUOT: (DiskFullError, _FULL),
    errno.EFBIG: (DiskFullError, _FULL),
    errno.EROFS: (ReadOnlyError, _READ_ONLY),
    errno.EACCES: (ReadOnlyError, _READ_ONLY),
    errno.EPERM: (ReadOnlyError, _READ_ONLY),
    errno.EEXIST: (RecordsError, _NO_FOLDER),
    errno.ENOTDIR: (RecordsError, _NO_FOLDER),
    errno.EISDIR: (RecordsError, _NO_FOLDER),
}


def map_error(error: Exception, place: str) -> RecordsError:
    """Convert what a write or read raised to a `RecordsError`.

    Args:
        error: from SQLAlchemy, sqlite3 or the operating system.
        place: the file.
    """
    if isinstance(error, RecordsError):
        return error
    said = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    if isinstance(said, sqlite3.Error):
        code = getattr(said, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
        kind, (cause, remedy) = _SQLITE.get(code, (RecordsError, (f"the database refused: {said}", "see the log")))
        return kind(f"{place}: {cause} ({said})", remedy)
    if isinstance(said, OSError):
        kind, (cause, remedy) = _SYSTEM.get(said.errno or 0, (DiskError, _DISK))
        return kind(f"{place}: {cause} ({said.strerror or said})", remedy)
    if isinstance(said, (StatementError, ValueError, TypeError)):
        return BadRecordError(f"what was to be recorded is malformed: {said}", "this is a fault of the program")
    return RecordsError(f"{place}: {type(said).__name__}: {said}", "see the log")
