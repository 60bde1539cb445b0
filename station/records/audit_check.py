"""Whether the audit trail is whole: every row as it was written, each behind the one before, none cut off."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sqlalchemy import Connection, select

from station.records.audit import CONTINUED, GENESIS, RESTORED, AuditRow, last_row, row_of
from station.records.audit_head import Head
from station.records.schema import audit


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """What was found."""

    rows: int
    """How many were looked at."""
    head: Head | None
    """The last row; None of an empty trail."""
    broken: tuple[str, ...]
    """What is wrong, the first broken row first; empty where the trail is whole."""
    restored: tuple[str, ...]
    """Rows that are missing because a person put a backup back, which the trail tells of; no fault by itself."""


def check_audit(connection: Connection, kept: Head | None, anchors: Iterable[Head] = (), since: int = 0) -> AuditCheck:
    """Go through the trail from its first row to its last.

    Args:
        connection: any.
        kept: the head as kept outside the database; None where it is missing.
        anchors: rows known from elsewhere, as from a backup or a printed report.
        since: leave out rows before this one, as where a break is known and explained.
    """
    broken: list[str] = []
    restored: list[str] = []
    number, before, hashes = 0, None, dict[int, str]()
    wanted = {anchor.seq for anchor in anchors} | ({kept.seq} if kept else set())
    for row in _rows(connection, since):
        number += 1
        if before is not None and (gap := _restored(row, before)):
            restored.append(gap)
        else:
            broken += _wrong(row, before, first_of_all=not since)
        if row.seq in wanted:
            hashes[row.seq] = row.hash
        before = row
    head = None if before is None else Head(before.seq, before.hash)
    broken += [text for anchor in anchors if (text := _missing(anchor, hashes, "the anchor"))]
    if kept is not None and kept.seq >= since and (text := _missing(kept, hashes, "the head kept beside the database")):
        broken.append(text)
    if kept is None and last_row(connection) is not None:
        broken.append("the head kept beside the database is missing: rows may have been cut off at the end")
    return AuditCheck(number, head, tuple(broken), tuple(restored))


def _rows(connection: Connection, since: int) -> Iterator[AuditRow]:
    for found in connection.execute(select(audit).where(audit.c.seq >= since).order_by(audit.c.seq)):
        yield row_of(found)


def _restored(row: AuditRow, before: AuditRow) -> str:
    """What a whole row says of the gap before it, where a backup ended with the row before; else empty."""
    behind = row.action == RESTORED and row.seq != before.seq + 1
    if not behind or row.hash != row.true_hash or row.previous_hash != before.hash:
        return ""
    told, lost = json.loads(row.new or "{}"), json.loads(row.old or "{}").get("audit")
    if lost is None or told.get("audit") != {"seq": before.seq, "hash": before.hash}:
        return ""
    return (
        f"row {row.seq}: {row.who} put back a backup that ends with row {before.seq}; rows up to {lost['seq']} "
        "are in the records that were moved aside then"
    )


def _wrong(row: AuditRow, before: AuditRow | None, *, first_of_all: bool) -> list[str]:
    """What is wrong with one row and its place."""
    wrong = []
    if row.hash != row.true_hash:
        wrong.append(f"row {row.seq}: it was changed: its content does not have its hash")
    if row.action == CONTINUED:
        known = json.loads(row.new or "null")
        here = f"up to row {before.seq}" if before else "no rows"
        told = f"row {known['seq']} was known to be the last" if known else "which one was the last was not known"
        wrong.append(f"row {row.seq}: rows before it are missing: a start found {here} here, and {told}")
    elif before is None and first_of_all and (row.seq != 1 or row.previous_hash != GENESIS):
        wrong.append(f"row {row.seq}: it is the first here, and rows 1 to {row.seq - 1} are missing")
    elif before is not None and row.seq != before.seq + 1:
        wrong.append(f"row {row.seq}: rows {before.seq + 1} to {row.seq - 1} before it are missing")
    if before is not None and row.previous_hash != before.hash:
        wrong.append(f"row {row.seq}: it was not written behind row {before.seq} as that is now")
    return wrong


def _missing(head: Head, hashes: dict[int, str], whose: str) -> str:
    if head.seq not in hashes:
        return f"row {head.seq}: it is missing, and {whose} names it: rows were cut off at the end"
    return "" if hashes[head.seq] == head.hash else f"row {head.seq}: it is not the one that {whose} names"
