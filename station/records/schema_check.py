"""Schema check: tables, indexes and triggers of a database, compared with those that the migrations make."""

import sqlite3

from sqlalchemy import create_engine
from sqlalchemy.pool import StaticPool

from station.records.database import plain
from station.records.errors import SchemaError
from station.records.migration import make_schema

_OBJECTS = """
SELECT type || ' ' || name, sql FROM sqlite_master WHERE sql IS NOT NULL
AND name NOT IN ('sqlite_sequence', 'sqlite_stat1', 'sqlite_stat4')
"""


def check_schema(database: sqlite3.Connection) -> list[str]:
    """Return what is missing, changed or added: without its triggers the audit trail could be changed by anybody."""
    try:
        found = _objects(database)
        (revision,) = database.execute("SELECT version_num FROM alembic_version").fetchone() or ("",)
        expected = _made(str(revision))
    except (sqlite3.Error, SchemaError) as error:
        return [f"the database's schema: {error}"]
    faults = [f"{name} is missing" for name in expected.keys() - found.keys()]
    faults += [f"{name} is not the station's" for name in found.keys() - expected.keys()]
    faults += [f"{name} was changed" for name in expected.keys() & found.keys() if found[name] != expected[name]]
    return [f"the database's schema: {fault}" for fault in sorted(faults)]


def _made(revision: str) -> dict[str, str]:
    engine = create_engine("sqlite://", poolclass=StaticPool)
    try:
        with engine.begin() as connection:
            make_schema(connection, revision)
            return _objects(plain(connection))
    finally:
        engine.dispose()


def _objects(database: sqlite3.Connection) -> dict[str, str]:
    """Return the text of each table, index and trigger, without quotes and spaces that change nothing."""
    return {name: " ".join(text.replace('"', "").split()) for name, text in database.execute(_OBJECTS)}
