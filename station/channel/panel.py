"""Requests of a person at the cell: recovery and alarms."""

from typing import Literal

from pydantic import Field

from station.channel.messages import ChannelMessage
from station.messages.message import Message

RecoveryName = Literal["protective-stop", "power", "program"]


class Actor(ChannelMessage):
    """Author of a request, authenticated by the pages; for the audit trail."""

    who: str = Field(min_length=1, max_length=64)
    role: str = Field(min_length=1, max_length=64)


class Recover(ChannelMessage):
    """Recover the arm after a stop, when a person has inspected the cell. Answered with `CommandDone`.

    It enables the arm, and moves nothing; the station continues only after a reset.
    """

    what: RecoveryName


class ListAlarms(ChannelMessage):
    """Query the alarms that are not in their normal state. Answered with `AlarmList`."""


class ListedAlarm(ChannelMessage):
    """One alarm, with its text in docs/alarms.md. Times are UTC, ms since 1970."""

    alarm: str
    """Its id, as `disk_low`."""
    number: int = Field(ge=1)
    priority: Literal["critical", "high", "medium", "low"]
    state: str
    """As docs/alarms.md names it: `unacknowledged`, `acknowledged`, `returned`, `shelved`, …"""
    active: bool
    """Its cause is there, or it is latched, and it is not shelved."""
    latched: bool
    """Active until a person has reset it, and never shelved."""
    detail: Message | None
    """The observation when it was last raised."""
    since_utc_ms: int = Field(ge=0)
    raised: int = Field(ge=0)
    """Number of activations; more than one for a chattering alarm."""
    cause: Message
    consequence: Message
    action: Message
    document: str
    """Its document, as `docs/alarms.md#disk-low`."""
    shelved_until_utc_ms: int | None
    shelved_by: str
    """Empty where it is not shelved."""


class AlarmList(ChannelMessage):
    """Alarms, most urgent first; shelved ones are included."""

    alarms: tuple[ListedAlarm, ...]


class AlarmAction(ChannelMessage):
    """Action of a person on one alarm; answered with `CommandDone`, and written to the audit trail."""

    alarm: str = Field(max_length=64)
    """Its id."""
    who: str = Field(max_length=64)
    """The person's name, for the audit trail."""
    role: str = Field(max_length=64)
    """In what capacity, as `operator`, `quality`, `service`."""


class AcknowledgeAlarm(AlarmAction):
    """Acknowledge an alarm. Idempotent."""


class ShelveAlarm(AlarmAction):
    """Shelve an alarm, in the list and for the PLC; refused for a latched one and for one that is shelved."""

    reason: str = Field(max_length=1000)
    """The reason; never empty."""
    for_s: float = Field(gt=0, allow_inf_nan=False)
    """Duration, 8 h at most."""


class UnshelveAlarm(AlarmAction):
    """Unshelve an alarm before its time is over. Idempotent."""
