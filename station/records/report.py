"""Inspection report for a terminal: curve, judgement and explanation as text."""

import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from station.channel.line import Outcome
from station.messages.judge import AREA_NEAR
from station.messages.message import Message
from station.messages.reasons import reason_message
from station.records.first_press import is_first_press
from station.records.judgement import budget_rows, is_judgement
from station.records.model import CurvePoint, FullRecord, InspectionRecord, RecipeSnapshot
from station.records.queries import Summary
from station.records.texts import printable, size_sentence, sparkline


def format_inspection(record: FullRecord) -> str:
    """Describe one inspection in full."""
    return printable("\n".join(_described(record)))


def format_list(summaries: Sequence[Summary]) -> str:
    """Return a line for each inspection."""
    rows = [("number", "begun (UTC)", "trigger", "lot", "grower", "fruit", "outcome", "s", "reasons", "curve")]
    rows += [
        (
            str(summary.sequence),
            _time(summary.began_utc_ms),
            str(summary.trigger_id),
            summary.lot or "-",
            summary.grower or "-",
            summary.fruit,
            summary.outcome or "running",
            "-" if summary.duration_ms is None else f"{summary.duration_ms / 1000:.2f}",
            ", ".join(summary.reasons) or "-",
            sparkline(summary.areas_mm2) or "-",
        )
        for summary in summaries
    ]
    return printable(_columns(rows))


def _described(record: FullRecord) -> Iterator[str]:
    trigger, judged, standing = record.trigger, record.judged, record.standing
    fruit = trigger.recipe.name if trigger.recipe else "no recipe"
    yield f"inspection {record.sequence}: {fruit}, {standing.outcome if standing else 'running'}"
    yield _field(
        "trigger",
        f"{trigger.trigger_id}, encoder {trigger.encoder}, lot {trigger.lot or 'not named'}, start {record.boot}",
    )
    ended = f", took {standing.duration_ms / 1000:.3f} s" if standing and standing.duration_ms else ""
    yield _field("begun", f"{_time(trigger.began_utc_ms)} UTC{ended}")
    if trigger.simulated:
        yield _field("simulated", "a twin's device took part")
    yield _field("size", size_sentence(trigger.size))
    yield from _why(judged, standing)
    yield _field("published", _published_text(record))
    if trigger.recipe:
        yield from _recipe(trigger.recipe)
    if judged:
        yield from _judged(judged)
    yield _field("images", str(record.images_state or "none"))
    for image in record.images:
        step = "" if image.step is None else f" {image.step}"
        yield f"  {image.kind}{step}: {image.path}"


def _why(judged: InspectionRecord | None, standing: Outcome | None) -> Iterator[str]:
    if judged:
        area = "no valid area" if judged.area_mm2 is None else f"area {judged.area_mm2:.1f} mm² ({judged.area_px} px)"
        closing = "" if judged.closing_mm is None else f" at {judged.closing_mm:.2f} mm of closing"
        late = ", late" if judged.late else ""
        partial = ", ended before its last step" if judged.partial else ""
        yield _field("judged", f"{judged.outcome}, {area}{closing}{late}{partial}")
        judgement = judged.judgement
        if judgement is not None and not any(_repeats(message, judgement) for message in judged.explanation):
            yield f"  {judgement}"
        for message in judged.explanation:
            yield f"  {message}"
        if judged.first_press_findings is not None:
            yield f"  Pressed twice, since the first press did not decide: {judged.first_press_findings}"
        for reason in judged.reasons:
            yield f"  {reason}: {reason_message(reason)}"
    else:
        yield _field("judged", "not")
    if standing and (judged is None or judged.outcome != standing.outcome or judged.reasons != standing.reasons):
        yield _field("in force", standing.outcome)
        for reason in standing.reasons:
            yield f"  {reason}: {reason_message(reason)}"


def _repeats(message: Message, judgement: Message) -> bool:
    """Check whether a finding says the judgement's area and limit already."""
    return message.id == AREA_NEAR.id and message.parameters == judgement.parameters


def _published_text(record: FullRecord) -> str:
    if record.standing is None or record.published_utc_ms is None:
        return "not yet"
    told = f"{record.standing.outcome} at {_time(record.published_utc_ms)} UTC"
    if record.acknowledged_utc_ms is None:
        return f"{told}, not acknowledged"
    return f"{told}, acknowledged at {_time(record.acknowledged_utc_ms)} UTC"


def _recipe(recipe: RecipeSnapshot) -> Iterator[str]:
    revision = f", revision {recipe.revision}" if recipe.revision else ""
    yield _field("recipe", f"{recipe.name}, number {recipe.number}{revision}, SHA-256 {recipe.sha256[:16]}…")
    try:
        yield from _limits(json.loads(recipe.text))
    except (KeyError, TypeError):  # of another form than today's
        yield f"  {recipe.text}"


def _limits(recipe: Any) -> Iterator[str]:
    damage, early = recipe["damage"], recipe["early_stop"]
    if size := damage.get("size"):
        yield f"  limits for a fruit of {size['reference_mm']:g} mm:"
    for limit in damage["area"]:
        yield f"  fails above {limit['area_mm2']:g} mm² at {limit['closing_mm']:g} mm of closing"
    yield f"  fails above {damage['growth_mm2_per_mm']:g} mm² of growth per mm"
    yield f"  stops early above {early['area_mm2']:g} mm², or {early['growth_mm2_per_mm']:g} mm² of growth per mm"


def _judged(judged: InspectionRecord) -> Iterator[str]:
    if judged.curve:
        yield _field("curve", sparkline([point.area_mm2 for point in judged.curve]))
        yield "\n".join(f"  {line}" for line in _columns(_curve_rows(judged.curve)).splitlines())
    budget = [(text, f"{share:.1%}") for text, share in budget_rows(judged.measures)]
    if budget:
        yield _field("uncertainty", "of the judged area, each component's standard uncertainty")
        yield "\n".join(f"  {line}" for line in _columns(budget).splitlines())
    others = {
        name: value for name, value in judged.measures.items() if not (is_judgement(name) or is_first_press(name))
    }
    last = {"measures": others, "phases, s": judged.phases_s, "devices": judged.devices, "versions": judged.versions}
    for title, values in last.items():
        if values:
            yield _field(title, _pairs(values))


def _curve_rows(curve: Sequence[CurvePoint]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        ("step", "width mm", "closing mm", "area mm²", "px", "changed mm²", "px", "confidence", "flags")
    ]
    rows += [
        (
            str(point.step),
            f"{point.width_mm:.2f}",
            _number(point.closing_mm, ".2f"),
            _number(point.area_mm2, ".1f"),
            _number(point.area_px, "d"),
            _number(point.changed_area_mm2, ".1f"),
            _number(point.changed_area_px, "d"),
            _number(point.confidence, ".2f"),
            ", ".join(point.flags) or "-",
        )
        for point in curve
    ]
    return rows


def _pairs(values: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {_number(value, '.4g') if isinstance(value, float) else value}" for name, value in values.items()
    )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _field(title: str, text: str) -> str:
    return f"{title + ':':14}{text}"


def _time(utc_ms: int) -> str:
    return datetime.fromtimestamp(utc_ms / 1000, UTC).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _columns(rows: Sequence[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(line.rstrip() for line in lines)
