"""Origin of the outbox's entries: the database that numbered them."""

import uuid

from sqlalchemy import Connection, func, insert, select

from station.records.schema import origins, outbox


def begin_origin(connection: Connection) -> None:
    """Begin a new origin with the next entry, in a database that continues without the entries after its last one.

    A destination may have other entries under the same numbers, of the database before.
    """
    first = (connection.scalar(select(func.max(outbox.c.entry))) or 0) + 1
    # A database without entries has an origin already.
    connection.execute(insert(origins).values(first_entry=first, id=uuid.uuid4().hex).prefix_with("OR REPLACE"))
