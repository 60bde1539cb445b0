"""Marks: the true quality of inspected fruit, good or bad, as a person found it; thresholds are proposed from them."""

from typing import Literal, NamedTuple

from sqlalchemy import Connection, delete, select
from sqlalchemy.dialects.sqlite import insert as upsert

from station.clock import utc_ms
from station.messages import records as messages
from station.records.errors import UnknownInspectionError
from station.records.schema import inspections, marks

Mark = Literal["good", "bad"]


class Marked(NamedTuple):
    """One fruit's mark."""

    sequence: int
    mark: Mark
    by: str
    marked_utc_ms: int


def place_mark(connection: Connection, sequence: int, mark: Mark | None, by: str) -> Marked | None:
    """Mark a fruit, or remove its mark by None. Idempotent: the same mark again leaves the first one, with its author.

    Returns:
        The mark before; None if there was none.

    Raises:
        UnknownInspectionError: there is no such inspection.
    """
    if connection.scalar(select(inspections.c.sequence).where(inspections.c.sequence == sequence)) is None:
        raise UnknownInspectionError(messages.NO_INSPECTION(number=sequence), messages.LIST_SHOWS())
    row = connection.execute(select(marks).where(marks.c.sequence == sequence)).one_or_none()
    before = None if row is None else Marked(*row)
    if mark is None:
        connection.execute(delete(marks).where(marks.c.sequence == sequence))
    elif before is None or before.mark != mark:
        values = {"mark": mark, "by": by, "marked_utc_ms": utc_ms()}
        told = upsert(marks).values(sequence=sequence, **values)
        connection.execute(told.on_conflict_do_update(["sequence"], set_=values))
    return before


def read_marked(connection: Connection) -> list[Marked]:
    """Read all marks, in the order of the inspections."""
    return [Marked(*row) for row in connection.execute(select(marks).order_by(marks.c.sequence))]
