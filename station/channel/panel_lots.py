"""Messages of the operators' pages on lots, and on exports of a search's results."""

from typing import Annotated

from pydantic import Field

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.vocabulary import LONGEST_GROWER, LONGEST_LOT, OutcomeName, Reason

Text = Annotated[str, Field(max_length=64)]
Why = Annotated[str, Field(min_length=1, max_length=1000)]
UtcMs = Annotated[int, Field(ge=0, lt=2**63)]


class Search(ChannelMessage):
    """Conditions on inspections: all given ones have to be met."""

    lot: Annotated[str, Field(max_length=LONGEST_LOT)] | None = None
    grower: Text | None = None
    fruit: Text | None = None
    """The recipe's name."""
    from_utc_ms: UtcMs | None = None
    to_utc_ms: UtcMs | None = None
    outcome: OutcomeName | None = None
    reason: Reason | None = None


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

    name: str = Field(min_length=1, max_length=LONGEST_LOT)
    grower: str = Field(min_length=1, max_length=LONGEST_GROWER)
    actor: Actor


class EndLot(ChannelMessage):
    """End a lot. Idempotent; answered with `LotView`."""

    name: str = Field(min_length=1, max_length=LONGEST_LOT)
    actor: Actor


class NoteExport(ChannelMessage):
    """An export of a search's results, for the audit trail, before it begins. Answered with `Noted`."""

    search: Search
    actor: Actor
