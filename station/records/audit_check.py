"""Check of the audit trail: every row unchanged, linked to the row before, and none cut off."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sqlalchemy import Connection, select

from station.records.audit import CONTINUED, GENESIS, RESTORED, AuditRow, last_row, row_of
from station.records.audit_head import Head
from station.records.schema import audit


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """Result of the check."""

    rows: int
    """Number of rows checked."""
    head: Head | None
    """The last row; None for an empty trail."""
    broken: tuple[str, ...]
    """Faults, the first broken row first; empty if the trail is complete."""
    restored: tuple[str, ...]
    """Rows that are missing because a person restored a backup, as the trail records; no fault by itself."""


def check_audit(connection: Connection, saved: Head | None, anchors: Iterable[Head] = (), since: int = 0) -> AuditCheck:
    """Check the trail from its first row to its last.

    Args:
        saved: the head stored outside the database; None if it is missing.
        anchors: rows known from other sources, as a backup or a printed report.
        since: skip rows before this one, as after a known and explained break.
    """
    broken: list[str] = []
    restored: list[str] = []
    number, before, hashes = 0, None, dict[int, str]()
    wanted = {anchor.seq for anchor in anchors} | ({saved.seq} if saved else set())
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
    if (
        saved is not None
        and saved.seq >= since
        and (text := _missing(saved, hashes, "the head kept beside the database"))
    ):
        broken.append(text)
    if saved is None and last_row(connection) is not None:
        broken.append("the head kept beside the database is missing: rows may have been cut off at the end")
    return AuditCheck(number, head, tuple(broken), tuple(restored))


def _rows(connection: Connection, since: int) -> Iterator[AuditRow]:
    for found in connection.execute(select(audit).where(audit.c.seq >= since).order_by(audit.c.seq)):
        yield row_of(found)


def _restored(row: AuditRow, before: AuditRow) -> str:
    """Return what an intact row records of the gap before it, if a backup ended with the row before; else empty."""
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
    """Return the faults of one row and its place."""
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
