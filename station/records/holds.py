"""Holds: images that the quota does not remove until a person releases them."""

from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, exists, insert, or_, select, update

from station.messages import records as messages
from station.messages.message import Message
from station.records.clock import utc_ms
from station.records.errors import RecordsError
from station.records.schema import holds, inspections


class Hold(NamedTuple):
    """An active hold."""

    sequence: int | None
    lot: str | None
    """Of an inspection or of a lot."""
    reason: str
    by: str
    placed_utc_ms: int

    @property
    def description(self) -> str:
        """Describe the held thing."""
        return f"lot {self.lot}" if self.sequence is None else f"inspection {self.sequence}"


def hold(connection: Connection, thing: int | str, reason: str, by: str) -> Hold:
    """Hold the images of an inspection or a lot. Idempotent: the first reason remains.

    Args:
        thing: the inspection's sequence, or the lot's name.

    Raises:
        RecordsError: there is no such inspection or lot, or no reason is given.
    """
    _given(reason)
    active = _active(connection, thing)
    if active is not None:
        return active
    table = inspections.c
    condition = table.sequence == thing if isinstance(thing, int) else table.lot == thing
    if connection.scalar(select(table.sequence).where(condition).limit(1)) is None:
        raise RecordsError(_unknown(thing), messages.LIST_SHOWS())
    connection.execute(insert(holds).values(**_key(thing), reason=reason, by=by, placed_utc_ms=utc_ms()))
    held = _active(connection, thing)
    if held is None:
        raise RuntimeError("a hold was inserted and is not there")
    return held


def release(connection: Connection, thing: int | str, reason: str, by: str) -> Hold:
    """Release images for the quota; the hold itself remains in the history.

    Args:
        thing: as held.

    Raises:
        RecordsError: it is not held, or no reason is given.
    """
    _given(reason)
    active = _active(connection, thing)
    if active is None:
        raise RecordsError(_not_held(thing), messages.HOLDS_SHOW())
    connection.execute(
        update(holds)
        .where(_is(thing), holds.c.released_utc_ms.is_(None))
        .values(released_utc_ms=utc_ms(), released_by=by, release_reason=reason)
    )
    return active


def read_holds(connection: Connection) -> list[Hold]:
    """Read the active holds, oldest first."""
    rows = connection.execute(select(*_COLUMNS).where(holds.c.released_utc_ms.is_(None)).order_by(holds.c.id))
    return [Hold(*row) for row in rows]


def is_held() -> ColumnElement[bool]:
    """Return the condition that the inspection of the surrounding query is on hold."""
    return exists().where(
        holds.c.released_utc_ms.is_(None),
        or_(holds.c.sequence == inspections.c.sequence, holds.c.lot == inspections.c.lot),
    )


_COLUMNS = (holds.c.sequence, holds.c.lot, holds.c.reason, holds.c.by, holds.c.placed_utc_ms)


def _key(thing: int | str) -> dict[str, Any]:
    return {"sequence": thing} if isinstance(thing, int) else {"lot": thing}


def _is(thing: int | str) -> ColumnElement[bool]:
    return holds.c.sequence == thing if isinstance(thing, int) else holds.c.lot == thing


def _active(connection: Connection, thing: int | str) -> Hold | None:
    row = connection.execute(select(*_COLUMNS).where(_is(thing), holds.c.released_utc_ms.is_(None))).one_or_none()
    return None if row is None else Hold(*row)


def _unknown(thing: int | str) -> Message:
    return messages.NO_INSPECTION(number=thing) if isinstance(thing, int) else messages.NO_LOT(lot=repr(thing))


def _not_held(thing: int | str) -> Message:
    if isinstance(thing, int):
        return messages.INSPECTION_NOT_HELD(number=thing)
    return messages.LOT_NOT_HELD(lot=repr(thing))


def _given(reason: str) -> None:
    if not reason.strip():
        raise RecordsError(messages.NO_REASON(), messages.GIVE_REASON())
