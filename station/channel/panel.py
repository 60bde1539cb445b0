"""What a person at the cell asks the station, beside what the line's PLC does."""

from typing import ClassVar, Literal

from pydantic import Field

from station.channel.messages import Message

RecoveryName = Literal["protective-stop", "power", "program"]


class Actor(Message):
    """Who asks, as the pages have made sure of it; for the audit trail."""

    who: str = Field(min_length=1, max_length=64)
    role: str = Field(min_length=1, max_length=64)


class Recover(Message):
    """Bring the arm back after a stop: a person has looked at the cell. Answered with `CommandDone`.

    It makes the arm able to move, and moves nothing; the station goes on only after a reset.
    """

    asked: ClassVar[str] = "to bring the arm back"
    what: RecoveryName


class ListAlarms(Message):
    """Ask which alarms are not in their normal state. Answered with `AlarmList`."""

    asked: ClassVar[str] = "for its alarms"


class ListedAlarm(Message):
    """One alarm, with what docs/alarms.md says of it. Times are UTC, ms since 1970."""

    alarm: str
    """Its id, as `disk_low`."""
    number: int = Field(ge=1)
    priority: Literal["critical", "high", "medium", "low"]
    state: str
    """As docs/alarms.md names it: `unacknowledged`, `acknowledged`, `returned`, `shelved`, …"""
    active: bool
    """Its cause is there, or it is latched, and it is not shelved."""
    latched: bool
    """It stands until a person has reset it, and is never shelved."""
    detail: str
    """What was seen when it was last raised."""
    since_utc_ms: int = Field(ge=0)
    raised: int = Field(ge=0)
    """How often; more than once for one that comes and goes."""
    cause: str
    consequence: str
    action: str
    document: str
    """Where it is explained, as `docs/alarms.md#disk-low`."""
    shelved_until_utc_ms: int | None
    shelved_by: str
    """Empty where it is not shelved."""


class AlarmList(Message):
    """Most urgent first; those that are shelved are among them."""

    alarms: tuple[ListedAlarm, ...]
    longest_shelved_s: float
    """For so long one can be shelved at most."""


class OfAlarm(Message):
    """What a person does with one alarm; answered with `CommandDone`, and told to the audit trail."""

    alarm: str = Field(max_length=64)
    """Its id."""
    who: str = Field(max_length=64)
    """The person's name, for the audit trail."""
    role: str = Field(max_length=64)
    """In what capacity, as `operator`, `quality`, `service`."""


class AcknowledgeAlarm(OfAlarm):
    """A person has seen it. Idempotent."""

    asked: ClassVar[str] = "to acknowledge an alarm"


class ShelveAlarm(OfAlarm):
    """Hide it for a time, from the list and from the PLC; refused for a latched one and for one that is shelved."""

    asked: ClassVar[str] = "to shelve an alarm"
    reason: str = Field(max_length=1000)
    """Why; never empty."""
    for_s: float = Field(gt=0, allow_inf_nan=False)
    """How long, `AlarmList.longest_shelved_s` at most."""


class UnshelveAlarm(OfAlarm):
    """Show it again before its time is over. Idempotent."""

    asked: ClassVar[str] = "to show a shelved alarm again"
