"""Holds: images that the quota does not remove until a person releases them."""

from typing import NamedTuple

from sqlalchemy import ColumnElement, Connection, Table, distinct, exists, func, insert, or_, select, update

from station.clock import utc_ms
from station.messages import records as messages
from station.records.errors import RecordsError
from station.records.schema import holds, images, inspections
from station.records.stored_message import images_state_of


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
    """Hold the images of an inspection, by its sequence, or a lot, by its name. Idempotent: the first reason remains.

    Raises:
        RecordsError: there is no such inspection or lot, or no reason is given.
    """
    _given(reason)
    active = _active(connection, thing)
    if active is not None:
        return active
    if connection.scalar(select(inspections.c.sequence).where(_is(thing, inspections)).limit(1)) is None:
        unknown = messages.NO_INSPECTION(number=thing) if isinstance(thing, int) else messages.NO_LOT(lot=repr(thing))
        raise RecordsError(unknown, messages.LIST_SHOWS())
    sequence, lot = (thing, None) if isinstance(thing, int) else (None, thing)
    held = Hold(sequence, lot, reason, by, utc_ms())
    connection.execute(insert(holds).values(held._asdict()))
    return held


def release(connection: Connection, thing: int | str, reason: str, by: str) -> Hold:
    """Release images, as held, for the quota; the hold itself remains in the history.

    Raises:
        RecordsError: it is not held, or no reason is given.
    """
    _given(reason)
    active = _active(connection, thing)
    if active is None:
        if isinstance(thing, int):
            raise RecordsError(messages.INSPECTION_NOT_HELD(number=thing), messages.HOLDS_SHOW())
        raise RecordsError(messages.LOT_NOT_HELD(lot=repr(thing)), messages.HOLDS_SHOW())
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


def describe_stored(connection: Connection, thing: int | str) -> str:
    """Describe which images of an inspection or lot exist: what was removed, or never stored, no hold brings back."""
    of_thing = _is(thing, inspections)
    rows = select(inspections.c.images_state, func.count(images.c.id), func.count(distinct(images.c.sequence)))
    joined = rows.outerjoin(images, images.c.sequence == inspections.c.sequence).where(of_thing)
    state, stored, with_images = connection.execute(joined).one()
    if isinstance(thing, int):
        return f"{stored} images ({images_state_of(state or '') or 'it has not ended'})"
    number = connection.scalar(select(func.count()).select_from(inspections).where(of_thing))
    return f"images of {with_images} of {number} inspections"


def is_held() -> ColumnElement[bool]:
    """Return the condition that the inspection of the surrounding query is on hold."""
    return exists().where(
        holds.c.released_utc_ms.is_(None),
        or_(holds.c.sequence == inspections.c.sequence, holds.c.lot == inspections.c.lot),
    )


_COLUMNS = (holds.c.sequence, holds.c.lot, holds.c.reason, holds.c.by, holds.c.placed_utc_ms)


def _is(thing: int | str, table: Table = holds) -> ColumnElement[bool]:
    return table.c.sequence == thing if isinstance(thing, int) else table.c.lot == thing


def _active(connection: Connection, thing: int | str) -> Hold | None:
    row = connection.execute(select(*_COLUMNS).where(_is(thing), holds.c.released_utc_ms.is_(None))).one_or_none()
    return None if row is None else Hold(*row)


def _given(reason: str) -> None:
    if not reason.strip():
        raise RecordsError(messages.NO_REASON(), messages.GIVE_REASON())
