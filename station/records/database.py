"""SQLite database file: opening, damage check, migration, and moving aside when it is damaged."""

import json
import math
import os
import shutil
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.pool import NullPool

from station.atomic_file import sync_folder
from station.messages import records as messages
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, DiskFullError, LockedError, ReadOnlyError, RecordsError, SchemaError

FILE_NAME = "records.sqlite3"
MIGRATIONS = Path(__file__).parent / "migrations"
CHECK_S = 5.0
"""Longest check of a large database at a start; SQLite itself reports damage found later."""
BUSY_MS = 1000


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
            connection.execute(f"PRAGMA journal_size_limit = {64 * 1024 * 1024}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
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
            connection.set_progress_handler(lambda: time.monotonic() > until_s, 10_000)
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


def migrate(engine: Engine, folder: Path) -> None:
    """Migrate the schema to the newest version, after a copy of the database was made in the folder's `backups`.

    Raises:
        SchemaError: it is a newer program's, or a migration failed; then it is unchanged.
        RecordsError: it cannot be read or written.
    """
    from alembic import command  # noqa: PLC0415 (it takes long to load, and who only reads needs none of it)
    from alembic.config import Config  # noqa: PLC0415
    from alembic.migration import MigrationContext  # noqa: PLC0415
    from alembic.script import ScriptDirectory  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    scripts = ScriptDirectory.from_config(config)
    backup: Path | None = None
    with engine.begin() as connection:
        found = MigrationContext.configure(connection).get_current_revision()
        if found == scripts.get_current_head():
            return
        known = {script.revision for script in scripts.walk_revisions()}
        if found is not None and found not in known:
            raise SchemaError(
                messages.NEWER_SCHEMA(path=str(engine.url.database), schema=found),
                messages.INSTALL_NEWER(folder=str(folder / "backups")),
            )
    if found is not None:
        backup = _backed_up(folder, found)
    try:
        with engine.begin() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")
    except Exception as error:
        told = map_error(error, str(folder / FILE_NAME))
        if isinstance(told, (DiskFullError, ReadOnlyError, LockedError, DamagedError)):
            raise told from error
        head = scripts.get_current_head()
        raise SchemaError(
            messages.NOT_MIGRATED(before=str(found), after=str(head), words=str(error)),
            messages.INSTALL_EARLIER_COPY(path=str(backup)) if backup else messages.INSTALL_EARLIER(),
        ) from error


def make_schema(connection: Connection, revision: str) -> None:
    """Make the tables, indexes and triggers of a version in an empty database.

    Raises:
        SchemaError: this program does not know the version.
    """
    from alembic import command  # noqa: PLC0415 (see `migrate`)
    from alembic.config import Config  # noqa: PLC0415
    from alembic.util import CommandError  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    try:
        command.upgrade(config, revision)
    except CommandError as error:
        raise SchemaError(
            messages.NEWER_SCHEMA(path=str(connection.engine.url.database), schema=revision), messages.USE_NEWER()
        ) from error


def _backed_up(folder: Path, revision: str) -> Path:
    """Copy the whole database, durably before the copy gets its name. What a killed start left is removed first."""
    backup = folder / "backups" / f"{stamp()}-form-{revision}.sqlite3"
    backup.parent.mkdir(exist_ok=True)
    for left in backup.parent.glob("*.partial"):
        left.unlink()
    size_bytes = (folder / FILE_NAME).stat().st_size
    if shutil.disk_usage(folder).free < 2 * size_bytes:
        raise DiskFullError(messages.NO_SPACE_FOR_COPY(path=str(backup), size_bytes=size_bytes), messages.FREE_SPACE())
    partial = backup.with_suffix(".partial")
    with closing(sqlite3.connect(folder / FILE_NAME)) as source, closing(sqlite3.connect(partial)) as target:
        source.backup(target)
    with partial.open("rb") as file:
        os.fsync(file.fileno())
    partial.rename(backup)
    sync_folder(backup.parent)
    return backup


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
