"""The audit trail: who changed or commanded what, when and why; each row's hash covers the row before it."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from typing import Any

from sqlalchemy import Connection, Row, bindparam, insert, select

from station.clock import utc_ms
from station.messages import records as messages
from station.records.audit_head import FILE_NAME as HEAD_NAME
from station.records.audit_head import Head
from station.records.errors import BadRecordError
from station.records.origin import begin_origin
from station.records.schema import audit

GENESIS = "0" * 64
"""The very first row's value for the hash of the row before."""
CONTINUED = "audit.continued"
"""Action of a row that records that rows before it are missing from this database."""
UNSIGNED = "audit.unsigned"
"""Action of a row that records that the rows before it were found without a signed head, as after a killed station."""
RESTORED = "records.restored"
"""Action of a row that records the restore of a backup; rows written since that backup are missing before it."""
STATION = "station"
"""Actor, and role, where no person acts."""
LONGEST_WORD, LONGEST_REASON = 64, 1000
"""Characters of who, role and action; of subject and reason."""

_LAST = select(audit).order_by(audit.c.seq.desc()).limit(1)
_NEWER = select(audit.c.seq, audit.c.hash).where(audit.c.seq > bindparam("known")).order_by(audit.c.seq.desc()).limit(1)
"""Made once: they run in each transaction."""
_SPARE_NUMBERS = 1000
"""Numbers left free where the trail continues without its last rows: rows newer than the saved head had them."""
_FORM = "fruit-station audit 1"


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """One entry, before it has its place in the trail."""

    who: str
    """A person's name or account; `station` or `plc` if no person acted. One printable line."""
    role: str
    """Role of `who`, as `operator`, `quality`, `service`, `plc`, `station`."""
    action: str
    """Action, as `recipe.approved`, `alarm.acknowledged`, `service.started`."""
    subject: str
    """Object of the action, as `recipe strawberry`, `alarm camera_lost`; may be empty."""
    reason: str = ""
    """Reason, as the person wrote it."""
    old: Any = None
    """Value before, as JSON."""
    new: Any = None
    """Value from now on, as JSON."""


@dataclass(frozen=True, slots=True)
class AuditRow:
    """A row of the trail."""

    seq: int
    """Rises by one, by more where known rows were lost; never given twice in one folder of records."""
    utc_ms: int
    who: str
    role: str
    action: str
    subject: str
    reason: str
    old: str | None
    """Canonical JSON."""
    new: str | None
    previous_hash: str
    hash: str

    @property
    def true_hash(self) -> str:
        """Return the SHA-256, hexadecimal, of the row's other columns."""
        columns = (self.seq, self.utc_ms, self.who, self.role, self.action, self.subject, self.reason)
        text = json.dumps([_FORM, *columns, self.old, self.new, self.previous_hash], ensure_ascii=True)
        return hashlib.sha256(text.encode("ascii")).hexdigest()


def append_audit(connection: Connection, entry: AuditEntry) -> AuditRow:
    """Append to the trail, within the write transaction of the audited change: both are durable, or neither.

    Raises:
        BadRecordError: a text is empty, too long or not printable, or a value has no JSON.
    """
    validate_entry(entry)
    return _append(connection, entry, last_row(connection), None)


def continue_audit(connection: Connection, known: Head | None) -> AuditRow | None:
    """Append a row if the head stored outside the database, or its absence, shows that rows are lost.

    Then the outbox too continues without its last entries: that row is the first entry of a new origin.

    Returns:
        That row, with the last row in this database as `old` and the last one known as `new`; None if no row is
        missing.
    """
    last = last_row(connection)
    if (known is None and last is None) or (known is not None and _continues(connection, known, last)):
        return None
    if known is None:
        reason = f"{HEAD_NAME} is missing or unreadable: whether these are the last rows of the trail is not known"
    else:
        reason = "the last rows of the trail are not in this database: it was replaced, cut or begun anew"
    entry = AuditEntry(STATION, STATION, CONTINUED, "audit", reason, _named(last), _named(known))
    begin_origin(connection)
    return _append(connection, entry, last, max(head.seq for head in (last, known) if head) + _SPARE_NUMBERS)


def note_unsigned(connection: Connection, known: Head | None) -> None:
    """Append, at a start, a row if rows follow the signed head.

    A killed station left them, or others wrote them.
    """
    last = last_row(connection)
    if known is not None and last is not None and last.seq > known.seq and _continues(connection, known, last):
        append_audit(connection, AuditEntry(STATION, STATION, UNSIGNED, "audit", "", _named(known), _named(last)))


def append_restored(connection: Connection, by: str, known: Head | None, new: dict[str, Any]) -> AuditRow:
    """Append, after a restored backup's last row, a row that records the restore; known newer rows leave a gap.

    Args:
        known: the head of the trail before the restore; None if there was none.
        new: what the row records of the backup.

    Raises:
        BadRecordError: the trail cannot store `by`.
    """
    last = last_row(connection)
    lost = known if known is not None and not has_row(connection, known) else None
    old = None if lost is None else {"audit": _named(lost)}
    entry = AuditEntry(by, "command line", RESTORED, "records", "", old, {**new, "audit": _named(last)})
    validate_entry(entry)
    seq = None if lost is None else max(lost.seq, last.seq if last else 0) + _SPARE_NUMBERS
    return _append(connection, entry, last, seq)


def has_row(connection: Connection, head: Head) -> bool:
    """Check that the trail has exactly this row."""
    return connection.scalar(select(audit.c.hash).where(audit.c.seq == head.seq)) == head.hash


def _continues(connection: Connection, known: Head, last: AuditRow | None) -> bool:
    """Check that the trail has the known row, or ends with a restore that replaced it.

    The restore's own head could not be saved then.
    """
    if has_row(connection, known):
        return True
    if last is None or last.action != RESTORED or last.old is None:
        return False
    return bool(json.loads(last.old)["audit"] == _named(known))


def newer_head(connection: Connection, known: Head | None) -> Head | None:
    """Return the trail's head if it is beyond the one last saved, else None."""
    found = connection.execute(_NEWER, {"known": known.seq if known else 0}).one_or_none()
    return None if found is None else Head(found.seq, found.hash)


def last_row(connection: Connection) -> AuditRow | None:
    """Return the trail's last row; None if it is empty."""
    found = connection.execute(_LAST).one_or_none()
    return None if found is None else row_of(found)


def row_of(found: Row[Any]) -> AuditRow:
    """Make a row from all of the table's columns."""
    return AuditRow(**found._asdict())


def canonical(value: Any) -> str | None:
    """Return canonical JSON: keys in order, no spaces; None for None.

    Raises:
        BadRecordError: the value has no JSON, as NaN.
    """
    if value is None:
        return None
    try:
        return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    except (ValueError, TypeError) as error:
        raise BadRecordError(
            messages.AUDIT_VALUE(value=f"{value!r:.200}", words=str(error)), messages.SEE_LOG()
        ) from error


def _named(head: Head | AuditRow | None) -> dict[str, Any] | None:
    return None if head is None else {"seq": head.seq, "hash": head.hash}


def _append(connection: Connection, entry: AuditEntry, last: AuditRow | None, seq: int | None) -> AuditRow:
    row = AuditRow(
        **asdict(replace(entry, old=canonical(entry.old), new=canonical(entry.new))),
        seq=seq or (last.seq + 1 if last else 1),
        utc_ms=utc_ms(),
        previous_hash=last.hash if last else GENESIS,
        hash="",
    )
    row = replace(row, hash=row.true_hash)
    connection.execute(insert(audit), asdict(row))
    return row


def validate_entry(entry: AuditEntry) -> None:
    """Check that the trail can store an entry's texts, before the action is carried out.

    Raises:
        BadRecordError: a text is empty, too long or not printable.
    """
    words = {"who": entry.who, "role": entry.role, "action": entry.action}
    for name, text in words.items():
        if not text.strip() or len(text) > LONGEST_WORD or not text.isprintable():
            raise BadRecordError(
                messages.AUDIT_WORD(field=name, most=LONGEST_WORD, text=f"{text!r:.100}"),
                messages.PROPER_WORD(field=name),
            )
    for name, text in {"subject": entry.subject, "reason": entry.reason}.items():
        if len(text) > LONGEST_REASON or not all(letter.isprintable() or letter == "\n" for letter in text):
            raise BadRecordError(
                messages.AUDIT_TEXT(field=name, most=LONGEST_REASON, text=f"{text!r:.100}"),
                messages.SHORTER_TEXT(field=name),
            )
