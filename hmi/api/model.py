"""Request and response models of the HTTP API. Times are UTC; a field without a value is null."""

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from hmi.past.past import FullRecord, Summary, judged_of
from station.channel.panel import ListedAlarm
from station.channel.panel_maintenance_queries import PartHealth
from station.channel.panel_queries import LotView
from station.messages.message import Message
from station.vocabulary import OutcomeName

LotName = Annotated[str, Field(min_length=1, max_length=32, pattern=r"^[ -~]*[!-~][ -~]*$")]
"""Printable ASCII, as in the PLC's registers."""
Grower = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]


class Model(BaseModel):
    """Base model that refuses unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ApiMessage(Model):
    """What the station says, as data."""

    id: str = Field(description="Stays the same when the text is reworded.")
    parameters: dict[str, int | float | str | Message | tuple[Message, ...]] = Field(
        description="Values of the text, by name; each may be a message itself."
    )
    text: str = Field(description="In English.")

    @classmethod
    def of(cls, message: Message) -> "ApiMessage":
        """Convert the station's message."""
        return cls(id=message.id, parameters=message.parameters, text=str(message))


class Error(Model):
    """The reason of a refused request."""

    detail: str = Field(description="One sentence, with what to do; in the language of the request.")
    message: ApiMessage | None = Field(default=None, description="The station's own, where it refused.")


class Part(Model):
    """One part that an inspection needs."""

    name: str
    state: Literal["ok", "degraded", "fault", "unknown"]
    age_s: float | None = Field(description="Since it was last heard.")
    detail: str = Field(description="The observation; empty where ok.")
    remedy: str = Field(description="What to do; empty where ok.")
    detail_message: ApiMessage | None
    remedy_message: ApiMessage | None

    @classmethod
    def of(cls, part: PartHealth) -> "Part":
        """Convert the station's answer."""
        return cls(
            name=part.name,
            state=part.state,
            age_s=part.age_s,
            detail=str(part.detail or ""),
            remedy=str(part.remedy or ""),
            detail_message=part.detail and ApiMessage.of(part.detail),
            remedy_message=part.remedy and ApiMessage.of(part.remedy),
        )


class HealthAnswer(Model):
    """Readiness of the station, and the state of each of its parts."""

    ready: bool = Field(description="A trigger would be accepted now.")
    why: str = Field(description="Why not, with the remedy; empty where ready.")
    why_message: ApiMessage | None
    mode: int = Field(description="PackML: 1 production, 2 maintenance, 3 manual.")
    simulated: bool
    parts: list[Part]
    versions: dict[str, str]


class AlarmAnswer(Model):
    """One alarm that is not in its normal state."""

    alarm: str = Field(description="Its id, as docs/alarms.md names it; stays.")
    number: int = Field(description="The PLC's error code.")
    priority: Literal["critical", "high", "medium", "low"]
    state: str
    active: bool = Field(description="Its cause is there, or it is latched, and it is not shelved.")
    since: datetime
    cause: ApiMessage
    consequence: ApiMessage
    action: ApiMessage
    detail: ApiMessage | None = Field(description="What was seen when it was last raised.")

    @classmethod
    def of(cls, alarm: ListedAlarm) -> "AlarmAnswer":
        """Convert the station's answer."""
        return cls(
            alarm=alarm.alarm,
            number=alarm.number,
            priority=alarm.priority,
            state=alarm.state,
            active=alarm.active,
            since=moment(alarm.since_utc_ms),
            cause=ApiMessage.of(alarm.cause),
            consequence=ApiMessage.of(alarm.consequence),
            action=ApiMessage.of(alarm.action),
            detail=alarm.detail and ApiMessage.of(alarm.detail),
        )


class AlarmAnswers(Model):
    """Most urgent first; shelved ones are included."""

    alarms: list[AlarmAnswer]


class InspectionSummary(Model):
    """One inspection in a list."""

    sequence: int = Field(description="The inspection's number; never given twice.")
    trigger_id: int
    began: datetime
    duration_s: float | None
    lot: str
    grower: str
    fruit: str = Field(description="The recipe's name.")
    outcome: OutcomeName | None = Field(description="Null while it runs.")
    reasons: list[str] = Field(description="The first one decided; empty only for PASS.")

    @classmethod
    def of(cls, row: Summary) -> "InspectionSummary":
        """Convert the station's answer."""
        return cls(
            sequence=row.sequence,
            trigger_id=row.trigger_id,
            began=moment(row.began_utc_ms),
            duration_s=None if row.duration_ms is None else row.duration_ms / 1000,
            lot=row.lot,
            grower=row.grower,
            fruit=row.fruit,
            outcome=row.outcome,
            reasons=list(row.reasons),
        )


class InspectionList(Model):
    """Newest first."""

    inspections: list[InspectionSummary]
    below: int | None = Field(description="Ask with it for the next page; null where this is the last.")


class Point(Model):
    """One width step."""

    step: int
    width_mm: float
    closing_mm: float | None
    area_mm2: float | None
    area_px: int | None
    confidence: float | None
    flags: list[str]
    changed_area_mm2: float | None = Field(default=None, description="How much of the image has changed.")
    changed_area_px: int | None = Field(default=None, description="The same.")


class InspectionDetails(Model):
    """One inspection."""

    sequence: int
    trigger_id: int
    encoder: int
    began: datetime
    ended: datetime | None
    duration_s: float | None
    lot: str
    simulated: bool = Field(description="A twin's device took part.")
    outcome: OutcomeName | None = Field(
        description="The published outcome, or the one to be published; null while it runs."
    )
    reasons: list[str]
    explanation: list[str] = Field(description="In English.")
    messages: list[ApiMessage] = Field(description="The explanation as data.")
    late: bool | None
    partial: bool | None
    area_mm2: float | None = Field(description="The contact area that decided.")
    closing_mm: float | None = Field(description="Where it was measured.")
    confidence: float | None
    recipe: str
    recipe_revision: str
    recipe_sha256: str
    curve: list[Point]
    devices: dict[str, str]
    versions: dict[str, str]
    images: list[str] = Field(description="SHA-256 of those kept.")
    published: datetime | None = Field(description="Time of publication to the PLC.")
    acknowledged: datetime | None = Field(description="When the PLC took it.")
    fruit_length_mm: float | None = Field(description="As the PLC gave it with the trigger; null where it did not.")
    size_class: int | None = Field(description="Likewise.")

    @classmethod
    def of(cls, record: FullRecord) -> "InspectionDetails":
        """Convert a record."""
        trigger, standing, judged = record.trigger, record.standing, judged_of(record)
        recipe = trigger.recipe
        return cls(
            sequence=record.sequence,
            trigger_id=trigger.trigger_id,
            encoder=trigger.encoder,
            began=moment(trigger.began_utc_ms),
            ended=None if standing is None else moment(standing.ended_utc_ms),
            duration_s=None if standing is None else standing.duration_ms / 1000,
            lot=trigger.lot,
            simulated=trigger.simulated,
            outcome=None if standing is None else standing.outcome,
            reasons=[] if standing is None else list(map(str, standing.reasons)),
            explanation=[str(message) for message in judged.explanation],
            messages=[ApiMessage.of(message) for message in judged.explanation],
            late=None if standing is None else standing.late,
            partial=None if standing is None else standing.partial,
            area_mm2=None if standing is None else standing.area_mm2,
            closing_mm=None if standing is None else standing.closing_mm,
            confidence=None if standing is None else standing.confidence,
            recipe=recipe.name if recipe else "",
            recipe_revision=recipe.revision if recipe else "",
            recipe_sha256=recipe.sha256 if recipe else "",
            curve=[Point.model_validate(point, from_attributes=True) for point in judged.curve],
            devices=dict(judged.devices),
            versions=dict(judged.versions),
            images=[image.sha256 for image in record.images],
            published=None if record.published_utc_ms is None else moment(record.published_utc_ms),
            acknowledged=None if record.acknowledged_utc_ms is None else moment(record.acknowledged_utc_ms),
            fruit_length_mm=trigger.size.length_mm,
            size_class=trigger.size.size_class,
        )


class RecipeSummary(Model):
    """The state of one recipe."""

    name: str
    title: str
    plc_number: int | None
    revision: int | None = Field(description="The approved one, by which fruit is inspected; null for none.")
    waiting: int | None = Field(description="The draft that waits for approval.")


class RecipeList(Model):
    """By name."""

    recipes: list[RecipeSummary]


class RecipeDetails(RecipeSummary):
    """A recipe in force, with its values."""

    values: dict[str, Any] | None = Field(description="As its JSON Schema has them; null where none is in force.")


class LotAnswer(Model):
    """One lot."""

    name: str
    grower: str
    began: datetime
    ended: datetime | None = Field(description="Null while it runs.")

    @classmethod
    def of(cls, reply: LotView) -> "LotAnswer":
        """Convert the station's answer."""
        ended = None if reply.ended_utc_ms is None else moment(reply.ended_utc_ms)
        return cls(name=reply.name, grower=reply.grower, began=moment(reply.began_utc_ms), ended=ended)


class LotList(Model):
    """Newest first."""

    lots: list[LotAnswer]


class LotBegin(Model):
    """The data of a lot that begins."""

    grower: Grower = Field(description="Whose fruit it is.")


def moment(utc_ms: int) -> datetime:
    """Convert a time of the station's, ms since 1970."""
    return datetime.fromtimestamp(utc_ms / 1000, UTC)
