"""Seals: the audit trail holds the hash of each concluded inspection, of its outcome and of its images.

A row of the trail seals one inspection's parts, each by its SHA-256. A part is sealed again only by what may change it:
the outcome when the PLC is given another one than was judged, the images when they are stored or removed.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from typing import Any

from sqlalchemy import Connection

from station.records.audit import STATION, AuditEntry, append_audit
from station.records.database import plain

SEALED = "inspection.sealed"
BEGAN = "seals.began"
"""Action of a row with the highest number given before the first seal, and the station's public key."""
SKIPPED = "numbers.skipped"
"""Action of a row with numbers that were given, and under which no inspection was made durable."""

_FORM = "fruit-station seal 1"
_PARTS = {
    "record": (
        """SELECT sequence, boot, trigger_id, encoder, lot, recipe_sha256, recipe_number, recipe_checksum, simulated,
        began_utc_ms, ended_utc_ms, duration_ms, judged, reasons, explanation, late, partial, area_mm2, area_px,
        closing_mm, confidence, phases_s, measures, devices, versions, fruit_length_mm_x10, size_class
        FROM inspections WHERE sequence = ?""",
        """SELECT step, width_mm, closing_mm, area_mm2, area_px, confidence, flags, captured_s, changed_area_mm2,
        changed_area_px FROM curve_points WHERE sequence = ? ORDER BY step""",
    ),
    "outcome": ("SELECT outcome, standing FROM inspections WHERE sequence = ?",),
    "images": (
        "SELECT images_state FROM inspections WHERE sequence = ?",
        "SELECT kind, step, sha256, size_bytes FROM images WHERE sequence = ? ORDER BY id",
    ),
}
"""What each part consists of. These are the seals' form: another one needs another name of the form."""
_GAPS = """
SELECT before + 1, sequence - 1 FROM (SELECT sequence, lag(sequence, 1, 0) OVER (ORDER BY sequence) AS before
FROM inspections) WHERE sequence > before + 1
"""
_UNSEALED = """
SELECT sequence FROM inspections WHERE sequence > :after AND {condition} AND sequence NOT IN (
SELECT CAST(substr(subject, 12) AS INTEGER) FROM audit WHERE action = :action AND json_extract(new, '$.{part}') <> '')
"""
_HAS_PART = {
    "record": "judged IS NOT NULL",
    "outcome": "outcome IS NOT NULL",
    "images": "EXISTS (SELECT 1 FROM images WHERE images.sequence = inspections.sequence)",
}


def seal(connection: Connection, sequence: int, *parts: str) -> None:
    """Append, in the transaction that stores them, the hashes of an inspection's `record`, `outcome` or `images`."""
    hashes = {part: part_hash(plain(connection), sequence, part) for part in parts}
    append_audit(connection, AuditEntry(STATION, STATION, SEALED, f"inspection {sequence}", new=hashes))


def begin_seals(connection: Connection, highest: int, public_key: str) -> None:
    """Append, at a start, a row where the seals begin, or where the station has another key."""
    found = _rows(plain(connection), BEGAN)
    if not found or found[-1]["public_key"] != public_key:
        new = {"after": highest, "public_key": public_key}
        append_audit(connection, AuditEntry(STATION, STATION, BEGAN, "records", new=new))


def note_skipped(connection: Connection, sequence: int) -> None:
    """Append a row if the numbers before a new inspection's were given to none that became durable."""
    (last,) = plain(connection).execute("SELECT coalesce(max(sequence), 0) FROM inspections").fetchone()
    if sequence > last + 1:
        append_skipped(connection, last + 1, sequence - 1)


def append_skipped(connection: Connection, first: int, last: int) -> None:
    """Append a row that there is no inspection with these numbers."""
    subject = f"{first}" if first == last else f"{first}-{last}"
    append_audit(connection, AuditEntry(STATION, STATION, SKIPPED, subject, new={"from": first, "to": last}))


def check_seals(connection: Connection) -> tuple[list[str], list[str]]:
    """Compare all inspections with their seals; the trail itself is checked by `check_audit`.

    Returns:
        Faults: what was changed, removed or added. Notes: what is not sealed.
    """
    database = plain(connection)
    after = min((row["after"] for row in _rows(database, BEGAN)), default=None)
    if after is None:
        (number,) = database.execute("SELECT count(*) FROM inspections").fetchone()
        return [], [f"none of {number} inspections is sealed: they are of an earlier version"] if number else []
    faults = [*_changed(database), *_unsealed(database, after), *_changed_recipes(database)]
    notes = []
    for first, last in _unexplained_gaps(database):
        text = f"inspections {first} to {last} are missing" if last > first else f"inspection {first} is missing"
        if last > after:
            faults.append(f"{text}, and the audit trail does not say why")
        else:
            notes.append(f"{text}, of before the seals")
    (older,) = database.execute("SELECT count(*) FROM inspections WHERE sequence <= ?", (after,)).fetchone()
    if older:
        notes.append(f"{older} inspections up to number {after} are of an earlier version, and not sealed")
    return faults, notes


def part_hash(database: sqlite3.Connection, sequence: int, part: str) -> str | None:
    """Return the hash of a part; None if there is no such inspection."""
    rows = [database.execute(query, (sequence,)).fetchall() for query in _PARTS[part]]
    if not rows[0]:
        return None
    return hashlib.sha256(json.dumps([_FORM, part, *rows], ensure_ascii=True).encode("ascii")).hexdigest()


def _rows(database: sqlite3.Connection, action: str) -> list[dict[str, Any]]:
    found = database.execute("SELECT new FROM audit WHERE action = ? ORDER BY seq", (action,))
    return [json.loads(new) for (new,) in found]


def _changed(database: sqlite3.Connection) -> Iterator[str]:
    """Yield the inspections that are missing, or differ from the last seal of a part."""
    wrong: dict[int, dict[str, str]] = {}
    sealed = database.execute("SELECT seq, subject, new FROM audit WHERE action = ? ORDER BY seq", (SEALED,))
    for row, subject, new in sealed:
        sequence = int(subject.removeprefix("inspection "))
        for part, sealed_hash in json.loads(new).items():
            found = part_hash(database, sequence, part)
            of_inspection = wrong.setdefault(sequence, {})
            of_inspection.pop(part, None)
            if found is None:
                of_inspection[part] = f"inspection {sequence}: it is missing; row {row} of the audit trail seals it"
            elif found != sealed_hash:
                of_inspection[part] = (
                    f"inspection {sequence}: {part} changed: row {row} of the audit trail seals another"
                )
            if not of_inspection:
                del wrong[sequence]
    for of_inspection in wrong.values():
        yield from dict.fromkeys(of_inspection.values())


def _unsealed(database: sqlite3.Connection, after: int) -> Iterator[str]:
    for part, condition in _HAS_PART.items():
        query = _UNSEALED.format(part=part, condition=condition)
        for (sequence,) in database.execute(query, {"after": after, "action": SEALED}):
            yield f"inspection {sequence}: {part} not sealed: it was not the station that added it"


def _changed_recipes(database: sqlite3.Connection) -> Iterator[str]:
    for sha256, name, text in database.execute("SELECT sha256, name, text FROM recipe_snapshots"):
        if hashlib.sha256(text.encode()).hexdigest() != sha256:
            yield f"recipe {name}: the text by which fruit were inspected was changed: it does not have its hash"


def _unexplained_gaps(database: sqlite3.Connection) -> Iterator[tuple[int, int]]:
    explained = [(row["from"], row["to"]) for row in _rows(database, SKIPPED)]
    for first, last in database.execute(_GAPS):
        if not any(begin <= first and last <= end for begin, end in explained):
            yield first, last
