"""PostgreSQL destination: rows and their position are one transaction, so none is lost or doubled."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any, LiteralString

import psycopg
from psycopg import AsyncConnection, sql

from station.messages import outbox as messages
from station.outbox.errors import OutboxError
from station.outbox.feed import Batch, Event, json_text
from station.outbox.secrets import password
from station.records.write_requests import OutboxKind
from station.settings.outbox import OutboxPostgresqlSettings

log = logging.getLogger(__name__)

SCHEMA_VERSION = 3
NAME = "postgresql"
_CONNECT_S = 5
_STATEMENT_MS = 60_000
_SILENT_MS = 20_000
"""A peer that acknowledges nothing for so long counts as lost."""
_IDLE_S, _INTERVAL_S, _PROBES = 10, 5, 3
"""TCP keepalives of both ends: with the usual two hours at the server's, a station that lost its power would find its
name taken by the session that it had before."""
_OPTIONS = (
    f"-c statement_timeout={_STATEMENT_MS} -c timezone=UTC -c tcp_user_timeout={_SILENT_MS} "
    f"-c tcp_keepalives_idle={_IDLE_S} -c tcp_keepalives_interval={_INTERVAL_S} -c tcp_keepalives_count={_PROBES}"
)

_INSPECTION: tuple[LiteralString, ...] = (
    "station", "sequence", "began", "ended", "duration_ms", "published", "lot", "fruit", "recipe_sha256", "outcome",
    "reasons", "judged", "explanation", "late", "partial", "simulated", "area_mm2", "area_px", "closing_mm",
    "confidence", "trigger_id", "encoder", "boot", "curve", "images", "images_state", "phases_s", "measures",
    "devices", "versions", "fruit_length_mm", "size_class", "origin", "entry",
)  # fmt: skip
_LOT: tuple[LiteralString, ...] = ("station", "name", "grower", "began", "ended", "revision", "origin", "entry")
_AUDIT: tuple[LiteralString, ...] = (
    "station", "seq", "hash", "previous_hash", "utc_ms", "at", "who", "role", "action", "subject", "reason", "old",
    "new", "origin", "entry",
)  # fmt: skip
_TABLES: dict[OutboxKind, tuple[LiteralString, tuple[LiteralString, ...], tuple[LiteralString, ...]]] = {
    "inspection": ("inspections", _INSPECTION, ("station", "sequence", "began")),
    "lot": ("lots", _LOT, ("station", "name")),
    "audit": ("audit", _AUDIT, ("station", "seq", "hash")),
}
"""By kind: the table, its columns, and its key. A row that exists is updated to the station's present state; one of the
audit trail never changes."""
_ROW_FAULTS = (psycopg.DataError, psycopg.IntegrityError, psycopg.errors.ProgramLimitExceeded)
"""Errors of a row, however often it is written; the last one is of a text that is too long for an index."""
_RECIPES: LiteralString = (
    "INSERT INTO recipes SELECT DISTINCT ON (data->>'recipe_sha256') data->>'recipe_sha256', data->>'fruit', "
    "(data->>'recipe_number')::integer, data->>'recipe_revision', data->'recipe' FROM incoming "
    "WHERE kind = 'inspection' AND data->>'recipe_sha256' IS NOT NULL ON CONFLICT DO NOTHING"
)


class Postgresql:
    """Connection to the database of many stations."""

    name = NAME

    def __init__(self, settings: OutboxPostgresqlSettings, station: str) -> None:
        self._settings, self._station = settings, station
        self.refused = 0
        """Rows that it did not take, which are in its table `refused`."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator["Session"]:
        """Connect, and check that the database is the right one and no other process publishes as this station.

        Raises:
            OutboxError: it cannot be reached or used, or the connection was lost in the block.
        """
        settings = self._settings
        place = f"{settings.host}:{settings.port}/{settings.database}"
        try:
            connection = await AsyncConnection.connect(
                host=settings.host,
                port=settings.port,
                dbname=settings.database,
                user=settings.user,
                password=password(settings.password_file, "PGPASSWORD"),
                sslmode=settings.tls,
                connect_timeout=_CONNECT_S,
                application_name=f"fruit-station {self._station}",
                keepalives=1,
                keepalives_idle=_IDLE_S,
                keepalives_interval=_INTERVAL_S,
                keepalives_count=_PROBES,
                tcp_user_timeout=_SILENT_MS,
                options=_OPTIONS,
            )
            async with connection:
                await self._prepare(connection)
                yield Session(self, connection, self._station)
        except psycopg.errors.UndefinedTable as error:
            raise OutboxError(
                messages.NO_TABLES(address=place), messages.LOAD(file="deploy/postgresql/schema.sql")
            ) from error
        except psycopg.errors.InsufficientPrivilege as error:
            cause = messages.NO_RIGHT(address=place, user=settings.user, error=_first_line(error))
            raise OutboxError(cause, messages.GRANT_ROLE()) from error
        except (psycopg.Error, OSError) as error:
            address = f"{settings.user}@{place}"
            cause = messages.UNREACHABLE(destination="PostgreSQL", address=address, error=_first_line(error))
            raise OutboxError(cause, messages.SEE_SERVER()) from error

    async def _prepare(self, connection: AsyncConnection[Any]) -> None:
        found = await (await connection.execute("SELECT max(version) FROM schema_version")).fetchone()
        if found != (SCHEMA_VERSION,):
            version = found and found[0]
            older = range(version, SCHEMA_VERSION) if isinstance(version, int) else ()
            upgrade = " and then ".join(f"deploy/postgresql/schema-{old}-to-{old + 1}.sql" for old in older)
            remedy = messages.LOAD(file=upgrade) if older else messages.UPDATE_STATION()
            raise OutboxError(messages.OTHER_SCHEMA(found=str(version), expected=SCHEMA_VERSION), remedy)
        lock = "SELECT pg_try_advisory_lock(hashtextextended('fruit-station ' || %s, 0))"
        if await (await connection.execute(lock, (self._station,))).fetchone() != (True,):
            raise OutboxError(messages.NAME_TAKEN(station=self._station), messages.OWN_NAME())
        await connection.execute(
            "CREATE TEMP TABLE incoming (entry bigint, kind text, data jsonb) ON COMMIT DELETE ROWS"
        )
        await connection.commit()


class Session:
    """An open connection."""

    def __init__(self, owner: Postgresql, connection: AsyncConnection[Any], station: str) -> None:
        self._owner, self._connection, self._station = owner, connection, station

    async def position(self, batch: Batch) -> int:
        """Return the last entry that the database has; 0 if it has none of this lineage."""
        query = "SELECT origin, last_entry FROM stations WHERE station = %s"
        rows = await (await self._connection.execute(query, (self._station,))).fetchall()
        await self._connection.commit()
        return batch.known(dict(rows)) or 0

    async def publish(self, batch: Batch) -> None:
        """Write the entries after the position, and their position: all of it, or nothing."""
        try:
            await self._write(batch.events)
        except _ROW_FAULTS as error:
            log.warning("a row was refused, they are written one by one: %s", _first_line(error))
            await self._connection.rollback()
            await self._write_one_by_one(batch)
        await self._connection.execute(
            "INSERT INTO stations VALUES (%s, %s, %s) ON CONFLICT (station, origin) DO UPDATE "
            "SET last_entry = EXCLUDED.last_entry, told = now()",
            (self._station, batch.lineage[0].id, batch.up_to),
        )
        await self._connection.commit()

    async def idle(self, pause_s: float) -> None:
        """Wait; raises if the connection ends meanwhile. TCP keepalives find a silent one (25 s)."""
        loop, heard, socket = asyncio.get_running_loop(), asyncio.Event(), self._connection.fileno()
        loop.add_reader(socket, heard.set)  # no request: the server only reports its end
        try:
            async with asyncio.timeout(pause_s):
                await heard.wait()
        except TimeoutError:
            return
        finally:
            loop.remove_reader(socket)
        await self._connection.execute("SELECT 1")
        await self._connection.commit()

    async def _write(self, events: Sequence[Event]) -> None:
        async with self._connection.cursor() as cursor:
            async with cursor.copy("COPY incoming FROM STDIN") as copy:
                for event in events:
                    await copy.write_row((event.entry, event.kind, json_text(event.data)))
            kinds: set[OutboxKind] = {event.kind for event in events}
            if "inspection" in kinds:
                await cursor.execute(_RECIPES)
            for kind in kinds:
                await cursor.execute(_statement(kind), (kind,))

    async def _write_one_by_one(self, batch: Batch) -> None:
        """Write rejected events to a table of their own, and continue."""
        await self._connection.execute("SELECT 1")  # so that each row below has a savepoint, not a transaction
        for event in batch.events:
            try:
                async with self._connection.transaction():
                    await self._write((event,))
                    # Only the commit empties the table: the next event's statement would take this one again.
                    await self._connection.execute("DELETE FROM incoming")
            except _ROW_FAULTS as error:
                self._owner.refused += 1
                row = (self._station, batch.lineage[0].id, event.entry, event.kind, _first_line(error))
                await self._connection.execute(
                    "INSERT INTO refused VALUES (%s, %s, %s, %s, %s, %s) ON CONFLICT DO NOTHING",
                    (*row, json_text(event.data)),
                )
                log.error("%s %s was refused: %s", event.kind, event.entry, _first_line(error))  # noqa: TRY400


def _statement(kind: OutboxKind) -> sql.Composed:
    table, columns, key = _TABLES[kind]
    names = sql.SQL(", ").join(map(sql.Identifier, columns))
    values = sql.SQL(", ").join(sql.SQL("(row).{}").format(sql.Identifier(name)) for name in columns)
    changes = sql.SQL(", ").join(
        sql.SQL("{0} = EXCLUDED.{0}").format(sql.Identifier(name)) for name in columns if name not in key
    )
    then = sql.SQL("NOTHING") if kind == "audit" else sql.SQL("UPDATE SET {}").format(changes)
    return sql.SQL(
        "INSERT INTO {table} ({names}) SELECT {values} FROM (SELECT entry, jsonb_populate_record(NULL::{table}, data) "
        "AS row FROM incoming WHERE kind = %s) AS told ORDER BY told.entry ON CONFLICT ({key}) DO {then}"
    ).format(
        table=sql.Identifier(table),
        names=names,
        values=values,
        key=sql.SQL(", ").join(map(sql.Identifier, key)),
        then=then,
    )


def _first_line(error: BaseException) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
