"""Direct writes from another process than the station's: short transactions of a person's commands.

SQLite separates two writers; each waits for the other's transaction, the station some milliseconds at most.
"""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError

from station.messages import records as messages
from station.records.audit import continue_audit, newer_head
from station.records.audit_head import read_head, try_save_head
from station.records.database import FILE_NAME, check, open_engine
from station.records.error_mapping import map_error
from station.records.errors import LockedError, RecordsError
from station.records.high_water_mark import MARK_NAME, HighWaterMark
from station.records.migration import migrate
from station.records.open import lock_folder, was_used


@contextmanager
def direct_transaction(folder: Path) -> Iterator[Connection]:
    """Run a transaction: durable when the block has ended, rolled back if it raised.

    If no station has the folder open, the first database is made, and one of an older schema is migrated.

    Raises:
        RecordsError: they cannot be written; nothing was changed.
    """
    path = folder / FILE_NAME
    try:
        _make_ready(folder)
        head = read_head(folder)
        with open_engine(path, "rw").connect() as connection:
            with connection.begin():
                continue_audit(connection, head)
                yield connection
                ahead = newer_head(connection, head)
            if ahead is not None:
                try_save_head(folder, ahead)
    except (DBAPIError, sqlite3.Error, OSError) as error:
        raise map_error(error, str(path)) from error


def _make_ready(folder: Path) -> None:
    """Migrate the database, unless a station has it open and has done so."""
    try:
        lock = lock_folder(folder)
    except LockedError:
        return
    try:
        path = folder / FILE_NAME
        if path.exists() and path.stat().st_size:
            check(path)
        elif was_used(folder, HighWaterMark(folder / MARK_NAME)):  # the start of the station moves the images aside
            raise RecordsError(messages.NO_RECORDS(path=str(path)), messages.RESTORE_OR_START())
        migrate(open_engine(path, "rwc"), folder)
    finally:
        os.close(lock)
