"""SQLite database file: opening, damage check, and moving aside when it is damaged."""

import json
import math
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.pool import NullPool

from station.messages import records as messages
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, RecordsError

FILE_NAME = "records.sqlite3"
CHECK_S = 5.0
"""Longest check of a large database at a start; SQLite itself reports damage found later."""
BUSY_MS = 1000
"""Longest wait of SQLite for another process's transaction, ms."""
_LOG_BYTES = 64 * 1024 * 1024
"""The write-ahead log is cut back to this after a checkpoint, bytes; an estimate."""
_CHECK_INSTRUCTIONS = 10_000
"""SQLite instructions between two checks of the time; an estimate."""


def records_folder(home: Path) -> Path:
    """Return the records' folder."""
    return home / "records"


def open_engine(path: Path, mode: Literal["ro", "rw", "rwc"]) -> Engine:
    """Make an engine with write-ahead logging, durable commits and real transactions.

    It pools no connection, so that nothing of it is left to be closed.

    Args:
        mode: read only, read and write, or made if missing.
    """
    read_only = mode == "ro"
    engine = create_engine(
        f"sqlite:///file:{path.absolute().as_posix().replace('%', '%25').replace('?', '%3f').replace('#', '%23')}"
        f"?mode={mode}&uri=true",
        poolclass=NullPool,
        json_serializer=_to_json,
    )

    @event.listens_for(engine, "connect")
    def _prepare(connection: sqlite3.Connection, _record: Any) -> None:
        connection.isolation_level = None  # the driver would begin and commit by its own rules
        connection.execute(f"PRAGMA busy_timeout = {BUSY_MS}")
        connection.execute("PRAGMA foreign_keys = ON")
        if not read_only:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute(f"PRAGMA journal_size_limit = {_LOG_BYTES}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        # A writer locks first: SQLite refuses the lock without waiting where another one wrote since its first read.
        connection.exec_driver_sql("BEGIN" if read_only else "BEGIN IMMEDIATE")

    return engine


def check(path: Path, within_s: float = CHECK_S) -> None:
    """Check an existing database for damage; of one that takes longer only the first part is checked.

    Raises:
        DamagedError: it is damaged.
        RecordsError: it cannot be read.
    """
    until_s = time.monotonic() + within_s
    try:
        with closing(sqlite3.connect(path, timeout=BUSY_MS / 1000)) as connection:
            connection.set_progress_handler(lambda: time.monotonic() > until_s, _CHECK_INSTRUCTIONS)
            found = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", 0) == sqlite3.SQLITE_INTERRUPT:
            return
        raise map_error(error, str(path)) from error
    if found != "ok":
        raise DamagedError(messages.DAMAGED(place=str(path), words=found), messages.OPEN_AGAIN())


def new_aside(folder: Path) -> Path:
    """Return the path of a new folder for what is moved aside, named with date and time."""
    return folder / "aside" / stamp()


def move_aside(folder: Path, aside: Path, *names: str) -> None:
    """Move a damaged database, and the files and folders that belong to it, out of the way; missing ones are skipped.

    Raises:
        OSError: it cannot be moved.
    """
    aside.mkdir(parents=True, exist_ok=True)
    for name in names:
        if (folder / name).exists():
            (folder / name).rename(aside / name)


def stamp() -> str:
    """Return date and time as part of a file's name, never the same twice."""
    return datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")


def existing(folder: Path) -> Path:
    """Return the path of a folder's database.

    Raises:
        RecordsError: there is none, or the folder cannot be entered.
    """
    path = folder / FILE_NAME
    try:
        path.stat()
    except FileNotFoundError:
        raise RecordsError(messages.NO_RECORDS(path=str(path)), messages.GIVE_HOME()) from None
    except OSError as error:
        raise map_error(error, str(path)) from error
    return path


@contextmanager
def reading(folder: Path) -> Iterator[Connection]:
    """Open a connection that cannot write, for another thread or process than the writer's.

    Raises:
        RecordsError: there are no records, or they cannot be read.
    """
    path = existing(folder)
    try:
        with open_engine(path, "ro").connect() as connection:
            yield connection
    except RecordsError:
        raise
    except Exception as error:
        raise map_error(error, str(path)) from error


def plain(connection: Connection) -> sqlite3.Connection:
    """Return the connection of sqlite3 itself, for what SQLAlchemy does not offer, or does too slowly."""
    driver = connection.connection.driver_connection
    if not isinstance(driver, sqlite3.Connection):
        raise TypeError(f"{driver} is no connection of sqlite3")
    return driver


def _to_json(value: Any) -> str:
    """Return JSON of any value: what has no JSON, as NaN, becomes null, so that no odd value costs a record."""
    return json.dumps(_finite(value), default=_number, ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def _number(value: Any) -> Any:
    """Convert numpy's numbers to Python's, anything else to text."""
    item = getattr(value, "item", None)
    return _finite(item()) if callable(item) else str(value)
