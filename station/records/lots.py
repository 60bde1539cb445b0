"""Lots as people or the packhouse's system register them: grower, start and end, each change with its audit entry."""

from sqlalchemy import Connection, insert, select, update

from station.channel.panel_lots import LotView
from station.clock import utc_ms
from station.messages import records as messages
from station.records.audit import AuditEntry, append_audit
from station.records.errors import RecordsError
from station.records.schema import lots
from station.records.write_requests import queue_event
from station.vocabulary import LONGEST_GROWER, LONGEST_LOT


def start_lot(connection: Connection, name: str, grower: str, by: tuple[str, str], *, correct: bool = False) -> LotView:
    """Register a lot's start, by the name that the PLC gives with each trigger. Idempotent; one that ended runs again.

    Args:
        by: name and role of who registers it, for the audit trail.
        correct: replace the grower registered before; one that ended remains so.

    Raises:
        RecordsError: the name or grower is invalid, or the lot is another grower's.
    """
    for bad, text in ((messages.BAD_LOT_NAME, name), (messages.BAD_GROWER, grower)):
        if not text.strip() or not text.isprintable():
            raise RecordsError(bad(text=repr(text)), messages.PRINTABLE_NAME())
    if len(name) > LONGEST_LOT:
        raise RecordsError(messages.LONG_LOT_NAME(letters=len(name)), messages.LONGEST_LOT_NAME(most=LONGEST_LOT))
    known = _known(connection, name)
    # A longer one may be from before there was this limit: its lot still starts again.
    if len(grower) > LONGEST_GROWER and (known is None or known.grower != grower):
        raise RecordsError(messages.LONG_GROWER(letters=len(grower)), messages.SHORTER_NAME(most=LONGEST_GROWER))
    if known is None:
        connection.execute(insert(lots).values(name=name, grower=grower, began_utc_ms=utc_ms(), revision=1))
    elif known.grower != grower:
        if not correct:
            raise RecordsError(
                messages.ANOTHER_GROWER(lot=name, known=known.grower, grower=grower), messages.CORRECT_LOT()
            )
        _change(connection, known, grower=grower)
    elif known.ended_utc_ms is None or correct:
        return known
    else:
        _change(connection, known, ended_utc_ms=None)
    old = None if known is None else {"grower": known.grower}
    append_audit(connection, AuditEntry(*by, "lot.told", f"lot {name}", old=old, new={"grower": grower}))
    return _changed(connection, name)


def end_lot(connection: Connection, name: str, by: tuple[str, str]) -> LotView:
    """Register a lot's end. Idempotent.

    Args:
        by: name and role of who registers it, for the audit trail.

    Raises:
        RecordsError: its start was not registered.
    """
    known = _known(connection, name)
    if known is None:
        raise RecordsError(messages.NO_LOT(lot=repr(name)), messages.REGISTER_LOT())
    if known.ended_utc_ms is not None:
        return known
    _change(connection, known, ended_utc_ms=utc_ms())
    append_audit(connection, AuditEntry(*by, "lot.ended", f"lot {name}"))
    return _changed(connection, name)


def read_lots(connection: Connection, limit: int, grower: str | None = None, name: str | None = None) -> list[LotView]:
    """Read the registered lots, or those of one grower or name, newest first."""
    query = select(*_COLUMNS).order_by(lots.c.id.desc()).limit(limit)
    for column, wanted in ((lots.c.grower, grower), (lots.c.name, name)):
        if wanted is not None:
            query = query.where(column == wanted)
    return [LotView(**row._asdict()) for row in connection.execute(query)]


_COLUMNS = (lots.c.name, lots.c.grower, lots.c.began_utc_ms, lots.c.ended_utc_ms, lots.c.revision)


def _known(connection: Connection, name: str) -> LotView | None:
    row = connection.execute(select(*_COLUMNS).where(lots.c.name == name)).one_or_none()
    return None if row is None else LotView(**row._asdict())


def _change(connection: Connection, lot: LotView, **values: object) -> None:
    connection.execute(update(lots).where(lots.c.name == lot.name).values(**values, revision=lot.revision + 1))


def _changed(connection: Connection, name: str) -> LotView:
    """Return the lot in its present state, and queue it for other systems."""
    columns = connection.execute(select(lots.c.id, *_COLUMNS).where(lots.c.name == name)).one()._asdict()
    queue_event(connection, "lot", columns.pop("id"))
    return LotView(**columns)
