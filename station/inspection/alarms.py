"""The life of alarms as values: what is active, seen, shelved, latched (ANSI/ISA-18.2-2016, alarm states)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Self

from pydantic import ConfigDict, TypeAdapter, ValidationError

from station.inspection.alarm_table import ALARMS, AlarmId, urgency
from station.messages.message import Message

LONGEST_SHELVED_S = 8 * 3600.0
"""One shift: what is hidden for longer is not an alarm."""
CHATTER_RAISES, CHATTER_S = 3, 60.0
"""An alarm raised so often within this time chatters: it stays until its cause was absent for as long."""


class AlarmState(StrEnum):
    """State of one alarm (ISA-18.2)."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned"
    """The cause is gone, and nobody has acknowledged it yet."""
    LATCHED_UNACKNOWLEDGED = "latched_unacknowledged"
    """The cause is gone, but it stays active until a person has reset it."""
    LATCHED = "latched"
    """Likewise, acknowledged."""
    SHELVED = "shelved"
    """Hidden for a time, its cause is there."""
    SHELVED_NORMAL = "shelved_normal"
    """Hidden for a time, its cause is not there."""


class AlarmEvent(StrEnum):
    """Event of an alarm."""

    RAISED = "raised"
    RETURNED = "returned"
    """Its cause is gone."""
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    """By a person, or at the end of its time."""
    RESET = "reset"
    """A person has confirmed that a latched one is over."""


N, E = AlarmState, AlarmEvent

LIFE: dict[tuple[AlarmState, AlarmEvent], AlarmState] = {
    (N.NORMAL, E.RAISED): N.UNACKNOWLEDGED,
    (N.NORMAL, E.SHELVED): N.SHELVED_NORMAL,
    (N.UNACKNOWLEDGED, E.ACKNOWLEDGED): N.ACKNOWLEDGED,
    (N.UNACKNOWLEDGED, E.RETURNED): N.RETURNED,
    (N.UNACKNOWLEDGED, E.SHELVED): N.SHELVED,
    (N.ACKNOWLEDGED, E.RETURNED): N.NORMAL,
    (N.ACKNOWLEDGED, E.SHELVED): N.SHELVED,
    (N.RETURNED, E.ACKNOWLEDGED): N.NORMAL,
    (N.RETURNED, E.RAISED): N.UNACKNOWLEDGED,
    (N.RETURNED, E.SHELVED): N.SHELVED_NORMAL,
    (N.SHELVED, E.RETURNED): N.SHELVED_NORMAL,
    # Also if it was acknowledged before: it appears in the operator's list anew.
    (N.SHELVED, E.UNSHELVED): N.UNACKNOWLEDGED,
    (N.SHELVED_NORMAL, E.RAISED): N.SHELVED,
    (N.SHELVED_NORMAL, E.UNSHELVED): N.NORMAL,
}
"""The life of a common alarm; what is not listed changes nothing."""

LATCHED_LIFE: dict[tuple[AlarmState, AlarmEvent], AlarmState] = {
    (N.NORMAL, E.RAISED): N.UNACKNOWLEDGED,
    (N.UNACKNOWLEDGED, E.ACKNOWLEDGED): N.ACKNOWLEDGED,
    (N.UNACKNOWLEDGED, E.RETURNED): N.LATCHED_UNACKNOWLEDGED,
    (N.ACKNOWLEDGED, E.RETURNED): N.LATCHED,
    (N.LATCHED_UNACKNOWLEDGED, E.ACKNOWLEDGED): N.LATCHED,
    (N.LATCHED_UNACKNOWLEDGED, E.RAISED): N.UNACKNOWLEDGED,
    (N.LATCHED_UNACKNOWLEDGED, E.RESET): N.NORMAL,
    (N.LATCHED, E.RAISED): N.UNACKNOWLEDGED,
    (N.LATCHED, E.RESET): N.NORMAL,
}
"""That of a latched one: it is never shelved, and only a person's reset after the cause is gone ends it."""

ACTIVE = (N.UNACKNOWLEDGED, N.ACKNOWLEDGED, N.LATCHED_UNACKNOWLEDGED, N.LATCHED)
"""In the PLC's alarm registers."""
SHOWN = (*ACTIVE, N.RETURNED)
"""In an operator's list."""
CAUSED = (N.UNACKNOWLEDGED, N.ACKNOWLEDGED, N.SHELVED)
"""The cause is there."""
SHELVES = (N.SHELVED, N.SHELVED_NORMAL)


@dataclass(frozen=True, slots=True)
class Alarm:
    """One alarm now. Times are UTC, seconds since 1970."""

    __pydantic_config__ = ConfigDict(allow_inf_nan=False, extra="forbid")

    id: AlarmId
    state: AlarmState = AlarmState.NORMAL
    detail: Message | None = None
    """What was seen when it was last raised, or found since then."""
    since_s: float = 0.0
    """When it became active."""
    raised: int = 0
    """How often since it was last over; a chattering alarm counts up and is published once."""
    raises_s: tuple[float, ...] = ()
    """When, the last three times."""
    quiet_since_s: float | None = None
    """When a chattering alarm's cause last went away."""
    shelved_until_s: float | None = None
    shelved_by: str = ""

    def chatters(self, now_s: float) -> bool:
        """Return whether the alarm comes and goes too often to be published each time."""
        return len(self.raises_s) == CHATTER_RAISES and now_s - self.raises_s[0] < CHATTER_S

    def over(self, now_s: float) -> bool:
        """Return whether the alarm can be dropped: it is normal, and was not raised within the chattering time."""
        return self.state == AlarmState.NORMAL and not any(0 <= now_s - raised < CHATTER_S for raised in self.raises_s)


@dataclass(frozen=True, slots=True)
class Alarms:
    """All alarms of a station, as a value. Each verb gives a new one; what a life does not list changes nothing."""

    known: Mapping[AlarmId, Alarm] = field(default_factory=dict)
    """Those that are not normal, or were raised a moment ago."""

    def get(self, alarm: AlarmId) -> Alarm:
        """One alarm."""
        return self.known.get(alarm) or Alarm(alarm)

    def raise_(self, alarm: AlarmId, now_s: float, detail: Message | None) -> Self:
        """Its cause is there. An active one stays as it is, with the new detail; a chattering one counts."""
        was = self.get(alarm)
        if was.state in CAUSED and was.quiet_since_s is None:
            return self._with(replace(was, detail=detail))
        again = replace(
            was,
            detail=detail,
            since_s=was.since_s if was.state in CAUSED else now_s,
            raised=was.raised + 1,
            raises_s=(*was.raises_s, now_s)[-CHATTER_RAISES:],
            quiet_since_s=None,
        )
        return self._with(_moved(again, E.RAISED))

    def returned(self, alarm: AlarmId, now_s: float) -> Self:
        """Its cause is gone; a chattering one stays until it has not come for a while (`tick`)."""
        was = self.get(alarm)
        if was.state in CAUSED and was.chatters(now_s):
            # The first return counts: it is quiet since then, until it is raised again.
            return self._with(replace(was, quiet_since_s=was.quiet_since_s or now_s))
        return self._after(alarm, E.RETURNED)

    def acknowledge(self, alarm: AlarmId) -> Self:
        """A person has seen it."""
        return self._after(alarm, E.ACKNOWLEDGED)

    def end(self, alarm: AlarmId) -> Self:
        """Its cause is gone for good, also where it chattered."""
        return self._with(_returned_for_good(self.get(alarm)))

    def acknowledge_returned(self) -> Self:
        """Acknowledge every alarm whose cause is gone: what the PLC's command does."""
        alarms = self
        for alarm in self.known.values():
            if alarm.state in (N.RETURNED, N.LATCHED_UNACKNOWLEDGED):
                alarms = alarms.acknowledge(alarm.id)
        return alarms

    def reset(self, alarm: AlarmId) -> Self:
        """A person resets a latched one whose cause is gone, also one that chattered until just now."""
        was = self.get(alarm)
        is_gone = ALARMS[alarm].latched and was.quiet_since_s is not None
        return self._with(_moved(_returned_for_good(was) if is_gone else was, E.RESET))

    def shelve(self, alarm: AlarmId, now_s: float, for_s: float, by: str) -> Self:
        """Hide it for a time from now (UTC), `LONGEST_SHELVED_S` at most; a latched one is never hidden."""
        if (self.get(alarm).state, E.SHELVED) not in _life(alarm):
            return self
        until_s = now_s + min(max(0.0, for_s), LONGEST_SHELVED_S)
        return self._with(replace(_moved(self.get(alarm), E.SHELVED), shelved_until_s=until_s, shelved_by=by))

    def unshelve(self, alarm: AlarmId) -> Self:
        """Show it again."""
        return self._after(alarm, E.UNSHELVED)

    def tick(self, now_s: float) -> Self:
        """End what time ends: shelving, and an alarm that no longer chatters. Call it about once a second."""
        ticked = (_ticked(alarm, now_s) for alarm in self.known.values())
        return type(self)({alarm.id: alarm for alarm in ticked if not alarm.over(now_s)})

    @property
    def not_normal(self) -> tuple[Alarm, ...]:
        """All that are not normal, also those that are shelved, most urgent first: by priority, the older first."""
        not_normal = [alarm for alarm in self.known.values() if alarm.state is not AlarmState.NORMAL]
        return tuple(sorted(not_normal, key=lambda alarm: (urgency(alarm.id)[0], alarm.since_s, urgency(alarm.id)[1])))

    def annunciated(self) -> tuple[Alarm, ...]:
        """Return the alarms in an operator's list, most urgent first."""
        return tuple(alarm for alarm in self.not_normal if alarm.state in SHOWN)

    @property
    def active(self) -> tuple[Alarm, ...]:
        """Of the shown alarms, those whose cause is there or that are latched."""
        return tuple(alarm for alarm in self.annunciated() if alarm.state in ACTIVE)

    @property
    def word(self) -> int:
        """The PLC's alarm registers as one number: bit n for an active alarm with number n + 1."""
        return sum(1 << ALARMS[alarm.id].number - 1 for alarm in self.active)

    @property
    def error_code(self) -> int:
        """The number of the most urgent active alarm, 0 for none."""
        return ALARMS[self.active[0].id].number if self.active else 0

    @classmethod
    def restored(cls, rows: Iterable[Mapping[str, Any]]) -> Self:
        """Return the alarms of stored rows; a row with an id or state that this version does not know is left out."""
        alarms = [alarm for row in rows if (alarm := _alarm(row)) is not None]
        return cls({alarm.id: alarm for alarm in alarms})

    def _after(self, alarm: AlarmId, event: AlarmEvent) -> Self:
        return self._with(_moved(self.get(alarm), event))

    def _with(self, alarm: Alarm) -> Self:
        return type(self)({**self.known, alarm.id: alarm})


def _life(alarm: AlarmId) -> dict[tuple[AlarmState, AlarmEvent], AlarmState]:
    return LATCHED_LIFE if ALARMS[alarm].latched else LIFE


def _moved(alarm: Alarm, event: AlarmEvent) -> Alarm:
    state = _life(alarm.id).get((alarm.state, event), alarm.state)
    if state in SHELVES:
        return replace(alarm, state=state)
    return replace(alarm, state=state, shelved_until_s=None, shelved_by="")


def _ticked(alarm: Alarm, now_s: float) -> Alarm:
    """An alarm after what time alone changes.

    However far the clock is set back, from then on shelving lasts `LONGEST_SHELVED_S` at most, and an alarm that
    chattered stays for `CHATTER_S` at most.
    """
    if alarm.shelved_until_s is not None and not 0 <= alarm.shelved_until_s - now_s <= LONGEST_SHELVED_S:
        alarm = _moved(alarm, E.UNSHELVED)
    if alarm.quiet_since_s is not None and not 0 <= now_s - alarm.quiet_since_s < CHATTER_S:
        alarm = _returned_for_good(alarm)
    return alarm


def _returned_for_good(alarm: Alarm) -> Alarm:
    """A chattering alarm whose cause is gone for good."""
    return _moved(replace(alarm, quiet_since_s=None, raises_s=()), E.RETURNED)


_ROW = TypeAdapter(Alarm)


def _alarm(row: Mapping[str, Any]) -> Alarm | None:
    """A remembered alarm; None where its id is no longer known, or its state is none of its life's."""
    try:
        alarm = _ROW.validate_python(row)
    except ValidationError:
        return None
    lives = {state for state, _ in _life(alarm.id)} | set(_life(alarm.id).values())
    return alarm if alarm.state in lives else None
