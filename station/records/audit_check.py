"""Check of the audit trail: every row unchanged, linked to the row before, and none cut off."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from sqlalchemy import Connection, select

from station.records.audit import CONTINUED, GENESIS, RESTORED, UNSIGNED, AuditRow, last_row, row_of
from station.records.audit_head import Head, read_head
from station.records.database import reading
from station.records.schema import audit
from station.records.signing import PublicKeys, public_keys_of

_HEAD_S, _AGAIN_S = 2.0, 0.02
"""Longest wait for the head of a running station, and time between two readings of it."""


@dataclass(frozen=True, slots=True)
class Proof:
    """Facts from outside the records to check them by: rows that must exist, public keys, the first row to check."""

    anchors: tuple[Head, ...] = ()
    """Rows that the trail must have, as from a backup or a printed report."""
    keys: PublicKeys = ()
    """The station's public key, and those that it had before; empty for the one in the records' folder."""
    since: int = 0
    """Rows before this one are not checked, as after a known and explained break."""


NO_PROOF = Proof()


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """Result of the check."""

    rows: int
    """Number of rows checked."""
    head: Head | None
    """The last row, with its signature if it was saved with one; None for an empty trail."""
    broken: tuple[str, ...]
    """Faults, the first broken row first; empty if the trail is complete."""
    notes: tuple[str, ...]
    """What the trail records and is no fault by itself: a restored backup, rows without a signed head."""


def check_trail(folder: Path, proof: Proof = NO_PROOF) -> AuditCheck:
    """Check the trail of a records' folder, also while the station writes: its head follows a row within milliseconds.

    Args:
        proof: what the person who checks knows from elsewhere; without keys the folder's own public key is used.

    Raises:
        RecordsError: there are no records, or they cannot be read.
        BadInputError: the folder's public key is damaged.
    """
    keys = proof.keys or public_keys_of(folder)
    until_s = time.monotonic() + _HEAD_S
    while True:
        head = read_head(folder)
        with reading(folder) as connection:
            last = last_row(connection)
            behind = keys and head is not None and last is not None and head.seq < last.seq
            if not behind or time.monotonic() > until_s:
                return check_audit(connection, head, replace(proof, keys=keys))
        time.sleep(_AGAIN_S)


def check_audit(connection: Connection, saved: Head | None, proof: Proof = NO_PROOF) -> AuditCheck:
    """Check the trail from its first row to its last.

    Args:
        saved: the head stored outside the database; None if it is missing.
        proof: the head, and each signed anchor, has to be signed by one of its keys. Without keys no signature is
            checked, and rows beyond the head are no fault.
    """
    anchors, since, keys = proof.anchors, proof.since, proof.keys
    broken: list[str] = []
    notes: list[str] = []
    number, before, hashes = 0, None, dict[int, str]()
    wanted = {anchor.seq for anchor in anchors} | ({saved.seq} if saved else set())
    for row in map(row_of, connection.execute(select(audit).where(audit.c.seq >= since).order_by(audit.c.seq))):
        number += 1
        if before is not None and (gap := _restored(row, before)):
            notes.append(gap)
        else:
            broken += _wrong(row, before, first_of_all=not since)
        notes += _unsigned(row)
        if row.seq in wanted:
            hashes[row.seq] = row.hash
        before = row
    head = None if before is None else Head(before.seq, before.hash)
    if saved is not None and head is not None and saved[:2] == head[:2]:
        head = saved
    broken += [text for anchor in anchors if (text := _missing(anchor, hashes, "the anchor"))]
    if (
        saved is not None
        and saved.seq >= since
        and (text := _missing(saved, hashes, "the head kept beside the database"))
    ):
        broken.append(text)
    if saved is None and last_row(connection) is not None:
        broken.append("the head kept beside the database is missing: rows may have been cut off at the end")
    if keys:
        broken += _signatures(saved, anchors, keys)
        if saved is not None and head is not None and head.seq > saved.seq:
            broken.append(
                f"rows {saved.seq + 1} to {head.seq}: the signed head does not name them: the station was killed "
                "before it signed them, and its next start notes that; or somebody else wrote them"
            )
    return AuditCheck(number, head, tuple(broken), tuple(notes))


def _signatures(saved: Head | None, anchors: tuple[Head, ...], keys: PublicKeys) -> Iterator[str]:
    """Yield the faults of the signatures."""
    if saved is not None and not saved.is_signed(keys):
        yield f"row {saved.seq}: the head kept beside the database is not signed by the station's key"
    for anchor in anchors:
        if anchor.signature and not anchor.is_signed(keys):
            yield f"row {anchor.seq}: the anchor is not signed by the station's key: it was changed, or is of another"


def _unsigned(row: AuditRow) -> Iterator[str]:
    if row.action == UNSIGNED:
        first, last = json.loads(row.old or "{}")["seq"] + 1, json.loads(row.new or "{}")["seq"]
        yield f"row {row.seq}: a start found rows {first} to {last} without a signed head, as a killed station leaves"


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
