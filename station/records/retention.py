"""Image retention: images removed for space, and lost images after a crash."""

from sqlalchemy import ColumnElement, Connection, Text, delete, func, literal_column, select

from station.messages import records as messages
from station.records.holds import is_held
from station.records.schema import images, inspections
from station.records.write_requests import add_event, add_images

_OUTCOME = literal_column("+inspections.outcome", Text)
"""The outcome, never by its index, which has a row for each fruit ever inspected: the `+` keeps SQLite from it, so that
it reads the images in their order, as many as the quota allows."""


def remove_oldest_images(connection: Connection, *, for_accepted: bool) -> tuple[int, list[str]] | None:
    """Remove the images of the inspection that goes first: the oldest accepted one, then the oldest of the others.

    An accepted fruit's images never displace a rejected one's, and what is on hold stays.

    Returns:
        The freed bytes and the names of the files that no row refers to any more; None if none may go.
    """
    oldest = _oldest(connection, _OUTCOME == "PASS")
    if oldest is None and not for_accepted:
        oldest = _oldest(connection, _OUTCOME != "PASS")
    if oldest is None:
        return None
    rows = connection.execute(select(images.c.sha256, images.c.size_bytes).where(images.c.sequence == oldest)).all()
    connection.execute(delete(images).where(images.c.sequence == oldest))
    sizes = {row.sha256: row.size_bytes for row in rows}
    kept = connection.scalars(select(images.c.sha256).where(images.c.sha256.in_(sizes))).all()
    free = {name: size for name, size in sizes.items() if name not in kept}
    add_images(connection, oldest, (), messages.IMAGES_REMOVED())
    return sum(free.values()), list(free)


def _oldest(connection: Connection, kind: ColumnElement[bool]) -> int | None:
    """Return the oldest inspection of a kind that has images and is not on hold."""
    return connection.scalar(
        select(images.c.sequence)
        .join(inspections, inspections.c.sequence == images.c.sequence)
        .where(kind, ~is_held())
        .order_by(images.c.sequence)
        .limit(1)
    )


def referred(connection: Connection) -> dict[str, int]:
    """Return the files that rows refer to, with their sizes."""
    query = select(images.c.sha256, func.max(images.c.size_bytes)).group_by(images.c.sha256)
    return {name: size for name, size in connection.execute(query)}  # noqa: C416 (rows are no pairs to dict)


def forget_missing(connection: Connection, missing: frozenset[str]) -> None:
    """Mark every inspection whose files, by their names, are missing as lost; the events store the names."""
    columns = images.c
    rows = connection.execute(select(columns.id, columns.sequence, columns.sha256).order_by(columns.sequence))
    lost: dict[int, dict[int, str]] = {}
    for row in rows:
        if row.sha256 in missing:
            lost.setdefault(row.sequence, {})[row.id] = row.sha256
    for sequence, names in lost.items():
        connection.execute(delete(images).where(columns.id.in_(names)))
        add_images(connection, sequence, (), messages.IMAGES_DROPPED(cause=messages.FILES_MISSING(number=len(names))))
        add_event(connection, "images_missing", sequence, {"sha256": list(names.values())})
