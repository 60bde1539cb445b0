"""Audit report: selected rows of the trail, as text for a terminal."""

import json
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, literal_column, select

from station.records.audit import AuditRow, row_of
from station.records.schema import audit
from station.records.seals import SEALED
from station.records.texts import printable

_LONGEST_VALUE = 300


def read_audit(
    connection: Connection, number: int, action: str = "", subject: str = "", below: int | None = None
) -> list[AuditRow]:
    """Read the last rows, oldest first.

    Args:
        action: rows of this action, or of all that start with it; if empty, all but the seals of inspections.
        subject: rows with this text in their subject; all if empty.
        below: only rows before this one.
    """
    query = select(audit).order_by(audit.c.seq.desc()).limit(number)
    if action:
        query = query.where(audit.c.action.startswith(action, autoescape=True))
    else:
        # The text itself, no parameter: only so SQLite uses the index of these rows.
        query = query.where(audit.c.action != literal_column(f"'{SEALED}'"))
    if subject:
        query = query.where(audit.c.subject.contains(subject, autoescape=True))
    if below is not None:
        query = query.where(audit.c.seq < below)
    return [row_of(found) for found in connection.execute(query)][::-1]


def format_rows(rows: Sequence[AuditRow]) -> str:
    """Format rows for a person, some lines each."""
    return printable("\n".join(line for row in rows for line in _lines(row)))


def _lines(row: AuditRow) -> Iterator[str]:
    when = datetime.fromtimestamp(row.utc_ms / 1000, UTC).strftime("%Y-%m-%d %H:%M:%S")
    who = row.who if row.who == row.role else f"{row.who} ({row.role})"
    yield f"{row.seq:6}  {when}  {row.action}  {row.subject}  by {who}"
    if row.reason:
        yield f"{'':8}{row.reason}"
    for name, text in (("old", row.old), ("new", row.new)):
        if text is not None:
            yield f"{'':8}{name}: {_short(json.loads(text))}"


def _short(value: Any) -> str:
    if isinstance(value, dict):
        value = ", ".join(f"{name} {_short(inner)}" for name, inner in value.items())
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    text = text.replace("\n", " ")
    return text if len(text) <= _LONGEST_VALUE else text[:_LONGEST_VALUE] + "…"
