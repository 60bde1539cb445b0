"""Read queries of the records; each a function of a connection that need not be the writer's."""

import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from sqlalchemy import Connection, Row, func, select

from station.channel.line import Outcome, OutcomeName
from station.messages import records as messages
from station.records.database import plain
from station.records.errors import UnknownInspectionError
from station.records.images import image_path
from station.records.model import (
    AlarmEntry,
    CurvePoint,
    FullRecord,
    InspectionRecord,
    OpenInspections,
    RecipeSnapshot,
    StoredAlarm,
    StoredImage,
    Trigger,
)
from station.records.schema import alarms, alarms_log, curve_points, images, inspections, recipe_snapshots
from station.records.stored_message import FIRST_PRESS, JUDGEMENT, from_stored, images_state_of

Stored = TypeVar("Stored", CurvePoint, InspectionRecord, RecipeSnapshot, StoredImage, Trigger)


class Summary(NamedTuple):
    """One inspection in a list."""

    sequence: int
    trigger_id: int
    began_utc_ms: int
    lot: str
    grower: str
    """Empty if it was not registered."""
    fruit: str
    outcome: OutcomeName | None
    """None while it runs."""
    reasons: tuple[str, ...]
    areas_mm2: tuple[float | None, ...]
    duration_ms: int | None
    """None while it runs, and where it is not known."""


def read_open(connection: Connection) -> OpenInspections:
    """Read the inspections that began and were not acknowledged."""
    table = inspections.c
    rows = connection.execute(
        select(table.sequence, table.trigger_id, table.standing)
        .where(table.acknowledged_utc_ms.is_(None))
        .order_by(table.sequence)
    ).all()
    return OpenInspections(
        tuple((row.sequence, row.trigger_id) for row in rows if row.standing is None),
        tuple(Outcome.model_validate_json(row.standing) for row in rows if row.standing is not None),
    )


def read_alarms(connection: Connection) -> tuple[StoredAlarm, ...]:
    """Read the alarms that were saved last, by their ids."""
    rows = connection.execute(select(alarms).order_by(alarms.c.id))
    return tuple(StoredAlarm(**dict[str, Any](row)) for row in rows.mappings())


def read_alarm_log(connection: Connection, limit: int, below: int | None = None) -> dict[int, AlarmEntry]:
    """Read the log of alarms by the rows' numbers, newest first; all of it, or what is below a number."""
    table = alarms_log.c
    query = select(table.row, table.utc_ms, table.id, table.change, table.detail, table.sequence)
    if below is not None:
        query = query.where(table.row < below)
    rows = connection.execute(query.order_by(table.row.desc()).limit(limit))
    return {number: AlarmEntry(*entry) for number, *entry in rows}


def read_inspection(connection: Connection, sequence: int, folder: Path) -> FullRecord:
    """Read all stored data of one inspection; the records' folder is that of the images' paths.

    Raises:
        UnknownInspectionError: there is no record of it.
    """
    row = connection.execute(select(inspections).where(inspections.c.sequence == sequence)).one_or_none()
    if row is None:
        first, last = connection.execute(
            select(func.min(inspections.c.sequence), func.max(inspections.c.sequence))
        ).one()
        there = messages.LIST_SHOWS_RANGE(first=first, last=last) if last else messages.RECORDS_EMPTY()
        raise UnknownInspectionError(messages.NO_INSPECTION(number=sequence), there)
    kept = connection.execute(select(images).where(images.c.sequence == sequence).order_by(images.c.id))
    standing = None if row.standing is None else Outcome.model_validate_json(row.standing)
    return FullRecord(
        sequence=sequence,
        trigger=_made(Trigger, row, recipe=_recipe(connection, row)),
        boot=row.boot,
        judged=_judged(connection, row),
        standing=standing,
        published_utc_ms=row.published_utc_ms,
        acknowledged_utc_ms=row.acknowledged_utc_ms,
        images=tuple(_made(StoredImage, image, path=image_path(folder.absolute(), image.sha256)) for image in kept),
        images_state=images_state_of(row.images_state),
    )


_SUMMARIES = """
SELECT i.sequence, i.trigger_id, i.began_utc_ms, i.lot, coalesce(l.grower, ''), coalesce(r.name, 'none'), i.outcome,
    json_extract(i.standing, '$.reasons'), nullif(json_extract(i.standing, '$.duration_ms'), 0)
FROM inspections AS i
LEFT JOIN recipe_snapshots AS r ON r.sha256 = i.recipe_sha256
LEFT JOIN lots AS l ON l.name = i.lot
WHERE i.sequence IN (SELECT value FROM json_each(?)) ORDER BY i.sequence DESC
"""
_AREAS = """
SELECT sequence, area_mm2 FROM curve_points WHERE sequence IN (SELECT value FROM json_each(?)) ORDER BY sequence, step
"""


def read_summaries(connection: Connection, sequences: Sequence[int]) -> list[Summary]:
    """Read some inspections for a list, highest number first; missing ones are left out."""
    database = plain(connection)  # through SQLAlchemy a page takes several times as long
    wanted = (json.dumps(list(sequences)),)
    areas: defaultdict[int, list[float | None]] = defaultdict(list)
    for sequence, area_mm2 in database.execute(_AREAS, wanted):
        areas[sequence].append(area_mm2)
    rows = database.execute(_SUMMARIES, wanted)
    return [Summary._make((*row[:7], tuple(json.loads(row[7] or "[]")), tuple(areas[row[0]]), row[8])) for row in rows]


def _recipe(connection: Connection, row: Any) -> RecipeSnapshot | None:
    if row.recipe_sha256 is None:
        return None
    found = connection.execute(select(recipe_snapshots).where(recipe_snapshots.c.sha256 == row.recipe_sha256)).one()
    return _made(RecipeSnapshot, found)


def _judged(connection: Connection, row: Any) -> InspectionRecord | None:
    if row.judged is None:
        return None
    points = connection.execute(
        select(curve_points).where(curve_points.c.sequence == row.sequence).order_by(curve_points.c.step)
    )
    measures = dict(row.measures)
    judgement, first_press = (
        None if (stored := measures.pop(name, None)) is None else from_stored(stored)
        for name in (JUDGEMENT, FIRST_PRESS)
    )
    return _made(
        InspectionRecord,
        row,
        outcome=row.judged,
        reasons=tuple(row.reasons),
        explanation=tuple(map(from_stored, row.explanation)),
        curve=tuple(_made(CurvePoint, point, flags=tuple(point.flags)) for point in points),
        measures=measures,
        judgement=judgement,
        first_press_findings=first_press,
    )


def _made(kind: type[Stored], row: Row[Any], **others: Any) -> Stored:
    """Make a dataclass from a row's columns of the same names; `others` have no column, or another value than its."""
    columns = row._asdict()
    return kind(**{each.name: columns[each.name] for each in fields(kind) if each.name in columns} | others)
