"""Write requests of the records, each a function of the writer's connection."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any, Literal

from pydantic import ValidationError
from sqlalchemy import Connection, bindparam, delete, insert, select, update

from station.channel.line import Outcome, Reason
from station.clock import utc_ms
from station.messages import records as messages
from station.messages.message import Message, text_of
from station.records.errors import BadRecordError, UnknownInspectionError
from station.records.model import AlarmEntry, CurvePoint, InspectionRecord, StoredAlarm, Trigger
from station.records.schema import (
    alarms,
    alarms_log,
    curve_points,
    events,
    images,
    inspections,
    outbox,
    recipe_snapshots,
)
from station.records.seals import append_skipped, note_skipped, seal
from station.records.search_index import index_hour, index_reasons
from station.records.stored_message import FIRST_PRESS, JUDGEMENT, to_stored

OutboxKind = Literal["inspection", "lot", "audit"]
_BEGUN = (
    "sequence",
    "trigger_id",
    "encoder",
    "lot",
    "recipe_number",
    "recipe_checksum",
    "simulated",
    "began_utc_ms",
    "fruit_length_mm_x10",
    "size_class",
)
"""What is known of an inspection when it begins: columns of its row and fields of its outcome."""
_UPDATE = update(inspections).where(inspections.c.sequence == bindparam("number"))
"""Sets the columns that are given. SQLAlchemy makes a statement anew for values that are part of it."""
_POINT = tuple(field.name for field in fields(CurvePoint))
_PENDING = (text_of(messages.IMAGES_PENDING()), "pending")  # the second: of versions before messages


def insert_trigger(connection: Connection, sequence: int, trigger: Trigger, boot: str) -> None:
    """Begin an inspection.

    Raises:
        BadRecordError: no outcome could ever be published for such a trigger.
    """
    recipe = trigger.recipe
    if recipe is not None:
        snapshot = {**asdict(recipe), "sha256": recipe.sha256, "checksum": recipe.checksum}
        connection.execute(insert(recipe_snapshots).prefix_with("OR IGNORE"), snapshot)
    begun = {
        **asdict(replace(trigger, recipe=None)),
        "sequence": sequence,
        "recipe_number": recipe.number if recipe else 0,
        "recipe_checksum": recipe.checksum if recipe else 0,
    }
    del begun["recipe"]
    _lost(begun)  # validates the trigger: even its station_lost outcome must be possible
    # Before the row is there: the gap is found by the highest number so far.
    note_skipped(connection, sequence)
    sha256 = recipe.sha256 if recipe else None
    connection.execute(insert(inspections), {**begun, "boot": boot, "recipe_sha256": sha256, "images_state": ""})
    index_hour(connection, sequence, trigger.began_utc_ms)


def begin_again(connection: Connection, sequence: int, trigger: Trigger, boot: str) -> None:
    """Begin an inspection that is not in this database, because the one in which it began was moved aside."""
    if connection.scalar(select(inspections.c.sequence).where(inspections.c.sequence == sequence)) is None:
        insert_trigger(connection, sequence, trigger, boot)


def withdraw(connection: Connection, sequence: int) -> None:
    """Withdraw an inspection whose caller was gone when it was durable; its number is not given again."""
    connection.execute(delete(inspections).where(inspections.c.sequence == sequence, inspections.c.outcome.is_(None)))
    append_skipped(connection, sequence, sequence)
    add_event(connection, "begin_withdrawn", sequence, {})


def conclude(
    connection: Connection, sequence: int, record: InspectionRecord, images_states: Mapping[str, Message]
) -> tuple[Outcome, Message | None]:
    """Store how an inspection ended, unless it is stored already.

    Args:
        images_states: state of its images, by the outcome that decides: `PASS` or `other`.

    Returns:
        The outcome in force, and the images' state; None if this record was not taken.
    """
    row = _row(connection, sequence)
    standing = None if row.standing is None else Outcome.model_validate_json(row.standing)
    if row.judged is not None and standing is not None:
        return standing, None
    judged = _judged(row._asdict(), record)
    # An outcome that the PLC was given stays in force; the judgement is stored beside it.
    standing = standing or judged
    passed = record.outcome == standing.outcome == "PASS"
    images_state = images_states["PASS" if passed else "other"]
    connection.execute(
        _UPDATE,
        {
            "number": sequence,
            "judged": record.outcome,
            "reasons": list(record.reasons),
            "explanation": [to_stored(message) for message in record.explanation],
            "late": record.late,
            "partial": record.partial,
            "area_mm2": judged.area_mm2,
            "area_px": judged.area_px,
            "closing_mm": judged.closing_mm,
            "confidence": judged.confidence,
            "ended_utc_ms": record.ended_utc_ms,
            "duration_ms": record.duration_ms,
            "phases_s": dict(record.phases_s),
            "measures": {**record.measures, **_messages(record)},
            "devices": dict(record.devices),
            "versions": dict(record.versions),
            "images_state": text_of(images_state),
            "outcome": standing.outcome,
            "standing": standing.model_dump_json(),
        },
    )
    if row.standing is None:
        index_reasons(connection, None, standing)
    if record.curve:
        points = [{name: getattr(point, name) for name in _POINT} | {"sequence": sequence} for point in record.curve]
        connection.execute(insert(curve_points), points)
    seal(connection, sequence, "record", "outcome")
    if row.published_utc_ms is not None:
        queue_event(connection, "inspection", sequence)
    return standing, images_state


def _messages(record: InspectionRecord) -> dict[str, Any]:
    """Return the messages that are stored among the measures."""
    messages = ((JUDGEMENT, record.judgement), (FIRST_PRESS, record.first_press_findings))
    return {name: to_stored(message) for name, message in messages if message is not None}


def publish(connection: Connection, outcome: Outcome, given_up_to: int, boot: str) -> bool:
    """Store that the PLC was given an outcome, unless it is stored already; True the first time."""
    table = inspections.c
    found = connection.execute(
        select(table.published_utc_ms, table.standing).where(table.sequence == outcome.sequence)
    ).one_or_none()
    if found is not None and found.published_utc_ms is not None:
        return False
    if found is None:
        if outcome.sequence > given_up_to:
            raise UnknownInspectionError(messages.NEVER_BEGUN(number=outcome.sequence), messages.ASK_OPEN())
        _insert_published(connection, outcome, boot)
    published = {"outcome": outcome.outcome, "standing": outcome.model_dump_json(), "published_utc_ms": utc_ms()}
    connection.execute(_UPDATE, {"number": outcome.sequence, **published})
    stood = None if found is None or found.standing is None else Outcome.model_validate_json(found.standing)
    index_reasons(connection, stood, outcome)
    # Only where it changes: another seal would cover a change that another program may have made since.
    if stood != outcome:
        seal(connection, outcome.sequence, "outcome")
    queue_event(connection, "inspection", outcome.sequence)
    return True


def queue_event(connection: Connection, kind: OutboxKind, row: int) -> None:
    """Queue a row's sequence, id or number for other systems: an inspection when published, and when it changes."""
    connection.execute(insert(outbox), {"kind": kind, "row": row})


def acknowledge(connection: Connection, sequence: int) -> int:
    """Store that the PLC has taken the published outcomes up to this sequence; returns their number."""
    table = inspections.c
    return connection.execute(
        update(inspections)
        .where(table.acknowledged_utc_ms.is_(None), table.published_utc_ms.is_not(None), table.sequence <= sequence)
        .values(acknowledged_utc_ms=utc_ms())
    ).rowcount


def end_open_inspections(connection: Connection) -> list[int]:
    """End, after a start, what was not surely delivered: NO_RESULT with `station_lost`; returns the sequences."""
    table = inspections.c
    rows = connection.execute(
        select(inspections).where(table.acknowledged_utc_ms.is_(None), table.published_utc_ms.is_(None))
    ).all()
    for row in rows:
        lost = _lost(row._asdict())
        connection.execute(
            update(inspections)
            .where(table.sequence == row.sequence)
            .values(outcome=lost.outcome, standing=lost.model_dump_json(), ended_utc_ms=lost.ended_utc_ms)
        )
        index_reasons(connection, None if row.standing is None else Outcome.model_validate_json(row.standing), lost)
        seal(connection, row.sequence, "outcome")
    lost_images = (
        update(inspections).where(table.images_state.in_(_PENDING)).values(images_state=text_of(messages.IMAGES_LOST()))
    )
    for row in connection.execute(lost_images.returning(table.sequence, table.published_utc_ms)).all():
        seal(connection, row.sequence, "images")
        if row.published_utc_ms is not None:
            queue_event(connection, "inspection", row.sequence)
    return [row.sequence for row in rows]


def replace_alarms(connection: Connection, active: Sequence[StoredAlarm], log: Sequence[AlarmEntry]) -> None:
    """Store these alarms and no others, and append to the log."""
    connection.execute(delete(alarms))
    if active:
        connection.execute(insert(alarms), [asdict(row) for row in active])
    if log:
        connection.execute(insert(alarms_log), [asdict(entry) for entry in log])


def add_event(connection: Connection, name: str, sequence: int | None, details: Mapping[str, Any]) -> None:
    """Append an event."""
    values = {"utc_ms": utc_ms(), "name": name, "sequence": sequence, "details": dict(details)}
    connection.execute(insert(events), values)


def add_images(connection: Connection, sequence: int, rows: Sequence[Mapping[str, Any]], state: Message) -> None:
    """Store the state of an inspection's images, with rows for new ones whose files are durable.

    Seals it, and queues the inspection if it is published.
    """
    if rows:
        connection.execute(insert(images), [{"sequence": sequence, **row} for row in rows])
    table = inspections.c
    changed = update(inspections).where(table.sequence == sequence).values(images_state=text_of(state))
    published_utc_ms = connection.scalar(changed.returning(table.published_utc_ms))
    seal(connection, sequence, "images")
    if published_utc_ms is not None:
        queue_event(connection, "inspection", sequence)


def _row(connection: Connection, sequence: int) -> Any:
    row = connection.execute(select(inspections).where(inspections.c.sequence == sequence)).one_or_none()
    if row is None:
        raise UnknownInspectionError(messages.NO_INSPECTION(number=sequence), messages.BEGIN_FIRST())
    return row


def _lost(begun: Mapping[str, Any]) -> Outcome:
    """Return the outcome for the PLC of an inspection that was not surely delivered."""
    return _outcome(
        begun,
        outcome="NO_RESULT",
        reasons=(Reason.STATION_LOST,),
        late=bool(begun.get("late")),
        partial=begun.get("judged") is None or bool(begun.get("partial")),
        area_mm2=None,
        area_px=None,
        closing_mm=None,
        confidence=None,
        ended_utc_ms=begun.get("ended_utc_ms") or utc_ms(),
        duration_ms=begun.get("duration_ms") or 0,
    )


def _judged(begun: Mapping[str, Any], record: InspectionRecord) -> Outcome:
    """Return the outcome for the PLC of a record."""
    if bool(record.reasons) == (record.outcome == "PASS"):
        raise BadRecordError(
            messages.WRONG_REASONS(
                number=begun["sequence"], outcome=record.outcome, reasons=", ".join(record.reasons) or "-"
            ),
            messages.SEE_LOG(),
        )
    return _outcome(
        begun,
        outcome=record.outcome,
        reasons=tuple(Reason(reason) for reason in record.reasons),
        late=record.late,
        partial=record.partial,
        area_mm2=None if record.area_mm2 is None else float(record.area_mm2),
        area_px=record.area_px,
        closing_mm=None if record.closing_mm is None else float(record.closing_mm),
        confidence=None if record.confidence is None else float(record.confidence),
        ended_utc_ms=record.ended_utc_ms,
        duration_ms=record.duration_ms,
    )


def _outcome(begun: Mapping[str, Any], **ended: Any) -> Outcome:
    try:
        return Outcome(**{name: begun[name] for name in _BEGUN}, **ended)
    except ValidationError as error:
        raise BadRecordError(
            messages.BAD_INSPECTION(number=begun["sequence"], words=str(error)), messages.SEE_LOG()
        ) from error


def _insert_published(connection: Connection, outcome: Outcome, boot: str) -> None:
    """Insert an inspection of which only the outcome is known: it began in a database that was moved aside."""
    connection.execute(
        insert(inspections).values(
            **outcome.model_dump(include={*_BEGUN, "ended_utc_ms", "duration_ms"}),
            boot=boot,
            images_state=text_of(messages.IMAGES_NONE()),
        )
    )
    index_hour(connection, outcome.sequence, outcome.began_utc_ms)
