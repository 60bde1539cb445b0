"""Search index, maintained by the writer: reasons and hours of inspections."""

from sqlalchemy import Connection, bindparam, delete, insert, select

from station.channel.line import Outcome
from station.records.schema import hours, inspections, reasons

HOUR_MS = 3_600_000
_HOUR_OF = (
    select(hours.c.hour)
    .where(hours.c.first_sequence <= bindparam("sequence"))
    .order_by(hours.c.first_sequence.desc())
    .limit(1)
)


def index_reasons(connection: Connection, before: Outcome | None, now: Outcome) -> None:
    """Update an inspection's reasons in the index, in the transaction that sets the outcome."""
    if before is not None and before.reasons:
        table = reasons.c
        for reason in set(before.reasons):
            connection.execute(
                delete(reasons).where(
                    table.reason == reason, table.outcome == before.outcome, table.sequence == before.sequence
                )
            )
    if now.reasons:
        connection.execute(
            insert(reasons),
            [{"reason": reason, "outcome": now.outcome, "sequence": now.sequence} for reason in set(now.reasons)],
        )


def index_hour(connection: Connection, sequence: int, began_utc_ms: int) -> None:
    """Add an inspection's hour to the index; mostly nothing is written, because the hour is that of the one before.

    An inspection may be older than others in the index: their entries do not change.
    """
    hour = began_utc_ms // HOUR_MS
    before = connection.scalar(_HOUR_OF, {"sequence": sequence})
    if before == hour:
        return
    followed = connection.scalar(select(inspections.c.sequence).where(inspections.c.sequence > sequence).limit(1))
    if followed is not None and before is not None:
        known = connection.scalar(select(hours.c.hour).where(hours.c.first_sequence == sequence + 1))
        if known is None:
            connection.execute(insert(hours).values(first_sequence=sequence + 1, hour=before))
    connection.execute(insert(hours).values(first_sequence=sequence, hour=hour))
