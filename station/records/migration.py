"""Migration of the database's schema, after a copy of the database was made."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine

from station.atomic_file import sync_file, sync_folder
from station.messages import records as messages
from station.records.database import FILE_NAME, stamp
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, DiskFullError, LockedError, ReadOnlyError, RecordsError, SchemaError

if TYPE_CHECKING:
    from alembic.config import Config

MIGRATIONS = Path(__file__).parent / "migrations"


def migrate(engine: Engine, folder: Path) -> None:
    """Migrate the schema to the newest version, after a copy of the database was made in the folder's `backups`.

    Raises:
        SchemaError: it is a newer program's, or a migration failed; then it is unchanged.
        RecordsError: it cannot be read or written.
    """
    try:
        _migrate(engine, folder)
    except RecordsError:
        raise
    except Exception as error:
        raise map_error(error, str(folder / FILE_NAME)) from error


def _migrate(engine: Engine, folder: Path) -> None:
    from alembic import command  # noqa: PLC0415 (it takes long to load, and who only reads needs none of it)
    from alembic.migration import MigrationContext  # noqa: PLC0415
    from alembic.script import ScriptDirectory  # noqa: PLC0415

    scripts = ScriptDirectory.from_config(_alembic_config())
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
            command.upgrade(_alembic_config(connection), "head")
    except Exception as error:
        mapped = map_error(error, str(folder / FILE_NAME))
        if isinstance(mapped, (DiskFullError, ReadOnlyError, LockedError, DamagedError)):
            raise mapped from error
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
    from alembic import command  # noqa: PLC0415 (see `_migrate`)
    from alembic.util import CommandError  # noqa: PLC0415

    try:
        command.upgrade(_alembic_config(connection), revision)
    except CommandError as error:
        raise SchemaError(
            messages.NEWER_SCHEMA(path=str(connection.engine.url.database), schema=revision), messages.USE_NEWER()
        ) from error


def _alembic_config(connection: Connection | None = None) -> "Config":
    """Return Alembic's configuration of these migrations, with the connection to run them on, if any."""
    from alembic.config import Config  # noqa: PLC0415 (see `_migrate`)

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


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
    sync_file(partial)
    partial.rename(backup)
    sync_folder(backup.parent)
    return backup
