"""Orders of the operators' pages on the records: lots, and what the audit trail has of exports."""

from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.vocabulary import OutcomeName, Reason

Text = Annotated[str, Field(max_length=64)]
Why = Annotated[str, Field(min_length=1, max_length=1000)]
UtcMs = Annotated[int, Field(ge=0, lt=2**63)]


class Search(ChannelMessage):
    """Conditions on inspections: all given ones have to be met."""

    lot: Annotated[str, Field(max_length=32)] | None = None
    grower: Text | None = None
    fruit: Text | None = None
    """The recipe's name."""
    from_utc_ms: UtcMs | None = None
    to_utc_ms: UtcMs | None = None
    outcome: OutcomeName | None = None
    reason: Reason | None = None


class Picture(ChannelMessage):
    """A picture's file."""

    model_config = ConfigDict(ser_json_bytes="base64", val_json_bytes="base64")
    media_type: str
    data: bytes


class LotView(ChannelMessage):
    """One lot."""

    name: str
    grower: str
    began_utc_ms: int
    ended_utc_ms: int | None
    """None while it runs."""
    revision: int
    """Counts the changes, from 1."""


class StartLot(ChannelMessage):
    """Begin a lot. Idempotent; answered with `LotView`."""

    purpose: ClassVar[str] = "to begin a lot"
    name: str = Field(min_length=1, max_length=32)
    grower: str = Field(min_length=1, max_length=64)
    actor: Actor


class EndLot(ChannelMessage):
    """End a lot. Idempotent; answered with `LotView`."""

    purpose: ClassVar[str] = "to end a lot"
    name: str = Field(min_length=1, max_length=32)
    actor: Actor


class NoteExport(ChannelMessage):
    """An export of a search's results, for the audit trail, before it begins. Answered with `Noted`."""

    purpose: ClassVar[str] = "to export inspections"
    search: Search
    actor: Actor
