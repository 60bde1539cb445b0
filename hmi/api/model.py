"""Request and response models of the HTTP API. Times are UTC; a field without a value is null."""

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from hmi.past.past import FullRecord, judged_of
from station.messages.message import Message
from station.vocabulary import LONGEST_GROWER, LONGEST_LOT, OutcomeName

LotName = Annotated[str, Field(min_length=1, max_length=LONGEST_LOT, pattern=r"^[ -~]*[!-~][ -~]*$")]
"""Printable ASCII, as in the PLC's registers."""
Grower = Annotated[str, Field(min_length=1, max_length=LONGEST_GROWER, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]


class Model(BaseModel):
    """Base model that refuses unknown fields; made of the station's own answers by their attributes."""

    model_config = ConfigDict(extra="forbid", frozen=True, from_attributes=True)


def moment(utc_ms: int) -> datetime:
    """Convert a time of the station's, ms since 1970."""
    return datetime.fromtimestamp(utc_ms / 1000, UTC)


Moment = Annotated[datetime, BeforeValidator(moment)]
"""From a time of the station's."""
Sentence = Annotated[str, BeforeValidator(lambda message: str(message or ""))]
"""Of a message of the station's; empty for none."""


class ApiMessage(Model):
    """A message of the station, as data."""

    id: str = Field(description="Stays the same when the text is reworded.")
    parameters: dict[str, int | float | str | Message | tuple[Message, ...]] = Field(
        description="Values of the text, by name; each may be a message itself."
    )
    text: str = Field(description="In English.")

    @classmethod
    def of(cls, message: Message) -> "ApiMessage":
        """Convert the station's message."""
        return cls(id=message.id, parameters=message.parameters, text=str(message))


MessageField = Annotated[ApiMessage, BeforeValidator(ApiMessage.of)]
"""From a message of the station's."""


class Error(Model):
    """The reason of a refused request."""

    detail: str = Field(description="One sentence, with what to do; in the language of the request.")
    message: ApiMessage | None = Field(default=None, description="The station's own, where it refused.")


class Part(Model):
    """One part that an inspection needs."""

    name: str
    state: Literal["ok", "degraded", "fault", "unknown"]
    age_s: float | None = Field(description="Since it was last heard.")
    detail: Sentence = Field(description="The observation; empty where ok.")
    remedy: Sentence = Field(description="What to do; empty where ok.")
    detail_message: MessageField | None = Field(validation_alias="detail")
    remedy_message: MessageField | None = Field(validation_alias="remedy")


class HealthAnswer(Model):
    """Readiness of the station, and the state of each of its parts."""

    ready: bool = Field(description="A trigger would be accepted now.")
    why: Sentence = Field(description="Why not, with the remedy; empty where ready.")
    why_message: MessageField | None = Field(validation_alias="why")
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
    since: Moment = Field(validation_alias="since_utc_ms")
    cause: MessageField
    consequence: MessageField
    action: MessageField
    detail: MessageField | None = Field(description="What was seen when it was last raised.")


class AlarmAnswers(Model):
    """Most urgent first; shelved ones are included."""

    alarms: list[AlarmAnswer]


class InspectionSummary(Model):
    """One inspection in a list."""

    sequence: int = Field(description="The inspection's number; never given twice.")
    trigger_id: int
    began: Moment = Field(validation_alias="began_utc_ms")
    duration_s: Annotated[float | None, BeforeValidator(lambda ms: None if ms is None else ms / 1000)] = Field(
        validation_alias="duration_ms",
        description="Null while it runs, and where it is not known: the station was killed.",
    )
    lot: str
    grower: str
    fruit: str = Field(description="The recipe's name.")
    outcome: OutcomeName | None = Field(description="Null while it runs.")
    reasons: list[str] = Field(description="The first one decided; empty only for PASS.")


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
    duration_s: float | None = Field(
        description="Null while it runs, and where it is not known: the station was killed."
    )
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
            duration_s=None if standing is None else standing.duration_ms / 1000 or None,
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
    began: Moment = Field(validation_alias="began_utc_ms")
    ended: Moment | None = Field(validation_alias="ended_utc_ms", description="Null while it runs.")


class LotList(Model):
    """Newest first."""

    lots: list[LotAnswer]


class LotBegin(Model):
    """The data of a lot that begins."""

    grower: Grower = Field(description="Whose fruit it is.")
