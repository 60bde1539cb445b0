"""What the writer notes so that an inspection is found quickly: its reasons and its hour."""

from sqlalchemy import Connection, delete, insert, select

from station.channel.line import Outcome
from station.records.schema import hours, inspections, reasons

HOUR_MS = 3_600_000


def note_reasons(connection: Connection, before: Outcome | None, now: Outcome) -> None:
    """Let an inspection be found by the reasons of what stands.

    Args:
        connection: the writer's, in the transaction that makes it stand.
        before: what stood, if anything did.
        now: what stands.
    """
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


def note_hour(connection: Connection, sequence: int, began_utc_ms: int) -> None:
    """Let an inspection be found by its time; mostly nothing is written, as the hour is the one before's.

    An inspection may lie before others that are noted already: theirs stay as they are.

    Args:
        connection: the writer's, in the transaction that inserts it.
        sequence: the inspection's.
        began_utc_ms: when it began.
    """
    hour = began_utc_ms // HOUR_MS
    before = connection.scalar(
        select(hours.c.hour).where(hours.c.first_sequence <= sequence).order_by(hours.c.first_sequence.desc()).limit(1)
    )
    if before == hour:
        return
    followed = connection.scalar(select(inspections.c.sequence).where(inspections.c.sequence > sequence).limit(1))
    if followed is not None and before is not None:
        known = connection.scalar(select(hours.c.hour).where(hours.c.first_sequence == sequence + 1))
        if known is None:
            connection.execute(insert(hours).values(first_sequence=sequence + 1, hour=before))
    connection.execute(insert(hours).values(first_sequence=sequence, hour=hour))
