"""Orders of the operators' pages on the records: lots, exports, reports; and their jobs.

A long operation is a job: it is started and polled, and the pages then send its files.
"""

from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.messages.message import Message
from station.vocabulary import OutcomeName, Reason

LARGEST_PAGE = 100

Sequence = Annotated[int, Field(ge=1, lt=2**32)]
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
    revision: int


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


class StartExport(ChannelMessage):
    """Export a search's results as a table, as a job."""

    purpose: ClassVar[str] = "to export inspections"
    search: Search
    form: Literal["csv", "parquet"]
    actor: Actor


class StartLotReport(ChannelMessage):
    """Write a lot's report, as a job."""

    purpose: ClassVar[str] = "for a lot's report"
    lot: str = Field(max_length=32)
    actor: Actor


class GetJob(ChannelMessage):
    """Query the state of a job."""

    purpose: ClassVar[str] = "for a job"
    job: str = Field(pattern=r"^[0-9a-f]{32}$")


class EndJob(ChannelMessage):
    """Cancel a job. Idempotent; answered with `JobView`."""

    purpose: ClassVar[str] = "to call a job off"
    job: str = Field(pattern=r"^[0-9a-f]{32}$")


class JobFile(ChannelMessage):
    """A file that a job has written."""

    path: str
    name: str
    size_bytes: int
    media_type: str


class JobView(ChannelMessage):
    """State of a job."""

    job: str
    kind: Literal["export", "lot_report", "whatif"]
    state: Literal["waiting", "running", "done", "failed", "ended"]
    done: int
    of: int
    """0 where it is not known."""
    message: Message | None
    """Why it failed: a limit of the queue, or the command's last output."""
    files: tuple[JobFile, ...]
    """Once it is done."""
