"""The life of alarms as values (ISA-18.2-2016, alarm state transitions): what is active, known, shelved, latched."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Self

from station.inspection.alarm_table import AlarmId


class AlarmState(StrEnum):
    """Where one alarm is."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned"
    """The cause is gone, and nobody has acknowledged it yet."""
    LATCHED_UNACKNOWLEDGED = "latched_unacknowledged"
    """The cause is gone, but it stands until a person has acknowledged and reset it."""
    LATCHED = "latched"
    """Likewise, acknowledged."""
    SHELVED = "shelved"
    """Hidden for a time, its cause is there."""
    SHELVED_NORMAL = "shelved_normal"
    """Hidden for a time, its cause is not there."""


class AlarmEvent(StrEnum):
    """What happens to an alarm."""

    RAISED = "raised"
    RETURNED = "returned"
    """Its cause is gone."""
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    """By a person, or at the end of its time."""
    RESET = "reset"
    """A person has confirmed a latched one."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """One alarm now. Times are UTC, seconds since 1970."""

    id: AlarmId
    state: AlarmState = AlarmState.NORMAL
    detail: str = ""
    """What was seen when it was last raised."""
    since_s: float = 0.0
    """When it became active."""
    raised: int = 0
    """How often since it was last normal; a chattering alarm counts up and is told once."""
    last_raised_s: float = 0.0
    shelved_until_s: float | None = None
    shelved_by: str = ""


@dataclass(frozen=True, slots=True)
class Alarms:
    """All alarms of a station, as a value: each verb gives a new one."""

    known: dict[AlarmId, Alarm] = field(default_factory=dict)
    """Those that are not normal."""

    def raise_(self, alarm: AlarmId, now_s: float, detail: str) -> Self:
        """Its cause is there; raising an active one again counts."""
        raise NotImplementedError

    def returned(self, alarm: AlarmId, now_s: float) -> Self:
        """Its cause is gone; a chattering one stays until it was quiet for a while (`tick`)."""
        raise NotImplementedError

    def acknowledge(self, alarm: AlarmId, now_s: float) -> Self:
        """A person has seen it."""
        raise NotImplementedError

    def reset(self, alarm: AlarmId, now_s: float) -> Self:
        """A person lets go a latched one whose cause is gone."""
        raise NotImplementedError

    def shelve(self, alarm: AlarmId, now_s: float, until_s: float, by: str) -> Self:
        """Hide it until a time, at most `LONGEST_SHELVED_S` from now; never one that is latched."""
        raise NotImplementedError

    def unshelve(self, alarm: AlarmId, now_s: float) -> Self:
        """Show it again."""
        raise NotImplementedError

    def tick(self, now_s: float) -> Self:
        """End what time ends: shelving, and a chattering alarm that was quiet. Call it about once a second."""
        raise NotImplementedError

    def active(self) -> tuple[Alarm, ...]:
        """What an operator sees, most urgent first: by priority, the older first."""
        raise NotImplementedError

    @property
    def word(self) -> int:
        """The PLC's 32 bits: bit n for an active alarm with number n + 1."""
        raise NotImplementedError

    @property
    def error_code(self) -> int:
        """The number of the most urgent active alarm, 0 for none."""
        raise NotImplementedError

    def to_data(self) -> list[dict[str, Any]]:
        """Plain data to remember over a restart."""
        raise NotImplementedError

    @classmethod
    def from_data(cls, data: object) -> Self:
        """What `to_data` gave; rows that no longer mean anything are left out."""
        raise NotImplementedError
