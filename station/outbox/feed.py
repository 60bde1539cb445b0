"""Feed of outbox events, read from the records in order, by a connection that cannot write."""

import json
import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from sqlalchemy import Connection, Row, func, select

from station.messages import records as messages
from station.records.database import reading
from station.records.errors import RecordsError
from station.records.schema import (
    audit,
    curve_points,
    images,
    inspections,
    lots,
    origins,
    outbox,
    recipe_snapshots,
)
from station.records.stored_message import FIRST_PRESS, JUDGEMENT, from_stored, images_state_of, to_stored
from station.records.write_requests import OutboxKind

LARGEST_BATCH = 500
_NEAR = 100
"""Entries before one that may date it: enough for a few fruit, few enough to be read with each batch."""
_LAST_UTC_MS = 253_402_300_799_000
"""The end of the year 9999: a clock beyond it must not block the outbox."""


class Event(NamedTuple):
    """One event to publish, in its present state."""

    entry: int
    kind: OutboxKind
    data: dict[str, Any]
    """Plain JSON; times are RFC 3339 texts, UTC."""


class Origin(NamedTuple):
    """A database that numbered entries; a restored one gives the same numbers to other entries."""

    id: str
    last_entry: int | None
    """The last entry of this database; None for the present one."""


class Batch(NamedTuple):
    """The next events."""

    lineage: tuple[Origin, ...]
    """The present database's origin first."""
    events: tuple[Event, ...]
    """A row that changed more than once is published once."""
    up_to: int
    """The last entry that these events cover."""
    last: int
    """The last entry of all."""
    oldest_utc_ms: int | None
    """Time of the first of them; None if there is nothing to publish."""

    def known(self, positions: dict[str, int]) -> int | None:
        """Return the last entry of this lineage that a destination has, by its positions; None if there is none."""
        for origin in self.lineage:
            if origin.id in positions:
                return min(positions[origin.id], self.last if origin.last_entry is None else origin.last_entry)
        return None


def read_batch(folder: Path, station: str, after: int, limit: int = LARGEST_BATCH) -> Batch:
    """Read the events after the last entry that was published.

    Raises:
        RecordsError: there are no records yet, or they cannot be read.
    """
    with reading(folder) as connection:
        lineage = _lineage(connection)
        last = connection.scalar(select(func.max(outbox.c.entry))) or 0
        entries = connection.execute(
            select(outbox).where(outbox.c.entry > after).order_by(outbox.c.entry).limit(limit)
        ).all()
        first: dict[tuple[str, int], int] = {}
        for entry in entries:
            first.setdefault((entry.kind, entry.row), entry.entry)
        events: list[Event] = []
        for kind, read in (("inspection", _inspections), ("lot", _lots), ("audit", _audit)):
            wanted = {row: entry for (of, row), entry in first.items() if of == kind}
            rows = read(connection, list(wanted))
            events += [
                Event(wanted[row], kind, {"station": station, "origin": lineage[0].id, "entry": wanted[row], **data})
                for row, data in rows.items()
            ]
        events.sort(key=lambda event: event.entry)
        oldest = None if not events else _queued_utc_ms(connection, entries[0])
    return Batch(lineage, tuple(events), entries[-1].entry if entries else after, last, oldest)


def json_text(data: dict[str, Any]) -> str:
    """Return an event's JSON, in one line, without what JSON, UTF-8 or PostgreSQL's jsonb cannot store."""
    try:
        text = _dumped(data)
    except ValueError:
        text = _dumped(_clean(data))
    if "\\u0000" in text:
        text = _dumped(_clean(data))
    return text.encode("utf-8", "replace").decode("utf-8")


def _lineage(connection: Connection) -> tuple[Origin, ...]:
    rows = connection.execute(select(origins).order_by(origins.c.first_entry.desc())).all()
    if not rows:
        raise RecordsError(messages.ORIGIN_MISSING(), messages.PUT_BACK_BACKUP())
    ends = [None, *(row.first_entry - 1 for row in rows)]
    return tuple(Origin(row.id, end) for row, end in zip(rows, ends, strict=False))


def _inspections(connection: Connection, sequences: list[int]) -> dict[int, dict[str, Any]]:
    table, points = inspections.c, curve_points.c
    curves: dict[int, list[dict[str, Any]]] = {sequence: [] for sequence in sequences}
    query = select(curve_points).where(points.sequence.in_(sequences)).order_by(points.sequence, points.step)
    for point in connection.execute(query):
        curves[point.sequence].append({name: value for name, value in point._asdict().items() if name != "sequence"})
    kept: dict[int, list[dict[str, Any]]] = {sequence: [] for sequence in sequences}
    for image in connection.execute(select(images).where(images.c.sequence.in_(sequences)).order_by(images.c.id)):
        kept[image.sequence].append(
            {"kind": image.kind, "step": image.step, "sha256": image.sha256, "size_bytes": image.size_bytes}
        )
    rows = connection.execute(
        select(inspections, recipe_snapshots.c.name, recipe_snapshots.c.revision, recipe_snapshots.c.text)
        .outerjoin(recipe_snapshots, recipe_snapshots.c.sha256 == table.recipe_sha256)
        .where(table.sequence.in_(sequences))
    )
    return {row.sequence: _inspection(row, curves[row.sequence], kept[row.sequence]) for row in rows}


def _inspection(row: Row[Any], curve: list[dict[str, Any]], kept: list[dict[str, Any]]) -> dict[str, Any]:
    standing: dict[str, Any] = json.loads(row.standing or "{}")
    explanation = [from_stored(stored) for stored in row.explanation or []]
    return {
        "sequence": row.sequence,
        "boot": row.boot,
        "trigger_id": row.trigger_id,
        "encoder": row.encoder,
        "fruit_length_mm": row.fruit_length_mm_x10 / 10 or None,
        "size_class": row.size_class or None,
        "lot": row.lot,
        "simulated": row.simulated,
        "began": _time(row.began_utc_ms),
        "ended": _time(standing.get("ended_utc_ms")),
        "duration_ms": standing.get("duration_ms") or None,
        "fruit": row.name,
        "recipe_number": row.recipe_number,
        "recipe_revision": row.revision,
        "recipe_sha256": row.recipe_sha256,
        "recipe": None if row.text is None else json.loads(row.text),
        "outcome": row.outcome,
        "reasons": standing.get("reasons", []),
        "judged": row.judged,
        "explanation": [str(message) for message in explanation],
        "messages": [to_stored(message) for message in explanation],
        "late": bool(standing.get("late")),
        "partial": bool(standing.get("partial")),
        "area_mm2": standing.get("area_mm2"),
        "area_px": standing.get("area_px"),
        "closing_mm": standing.get("closing_mm"),
        "confidence": standing.get("confidence"),
        "phases_s": row.phases_s or {},
        "measures": {
            name: str(from_stored(value)) if name in {JUDGEMENT, FIRST_PRESS} else value
            for name, value in (row.measures or {}).items()
        },
        "devices": row.devices or {},
        "versions": row.versions or {},
        "published": _time(row.published_utc_ms),
        "curve": curve,
        "images": kept,
        "images_state": str(images_state_of(row.images_state) or ""),
    }


def _lots(connection: Connection, ids: list[int]) -> dict[int, dict[str, Any]]:
    return {
        row.id: {
            "name": row.name,
            "grower": row.grower,
            "began": _time(row.began_utc_ms),
            "ended": _time(row.ended_utc_ms),
            "revision": row.revision,
        }
        for row in connection.execute(select(lots).where(lots.c.id.in_(ids)))
    }


def _audit(connection: Connection, seqs: list[int]) -> dict[int, dict[str, Any]]:
    """Read the trail's rows unchanged, so that their hashes can be checked anywhere; `utc_ms` is part of the hash."""
    rows = connection.execute(select(audit).where(audit.c.seq.in_(seqs)))
    return {row.seq: {**row._asdict(), "at": _time(row.utc_ms)} for row in rows}


def _queued_utc_ms(connection: Connection, entry: Row[Any]) -> int | None:
    """Return the time of an entry, which has none of its own: its row's, or a later one of the audit trail before it.

    A row may be old when it changes, as an inspection whose images make room, and the trail seals each change first.
    """
    column, key = {
        "inspection": (inspections.c.published_utc_ms, inspections.c.sequence),
        "lot": (func.coalesce(lots.c.ended_utc_ms, lots.c.began_utc_ms), lots.c.id),
        "audit": (audit.c.utc_ms, audit.c.seq),
    }[entry.kind]
    row_utc_ms = connection.scalar(select(column).where(key == entry.row))
    near = outbox.c.entry.between(entry.entry - _NEAR, entry.entry)
    before = select(outbox.c.row).where(outbox.c.kind == "audit", near)
    trail_utc_ms = connection.scalar(select(func.max(audit.c.utc_ms)).where(audit.c.seq.in_(before)))
    return max((found for found in (row_utc_ms, trail_utc_ms) if found is not None), default=None)


def _dumped(data: Any) -> str:
    return json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _clean(value: Any) -> Any:
    if isinstance(value, dict):
        return {_clean(key): _clean(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_clean(inner) for inner in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value.replace("\0", "\N{REPLACEMENT CHARACTER}") if isinstance(value, str) else value


def _time(utc_ms: int | None) -> str | None:
    if utc_ms is None:
        return None
    return datetime.fromtimestamp(min(utc_ms, _LAST_UTC_MS) / 1000, UTC).isoformat(timespec="milliseconds")
