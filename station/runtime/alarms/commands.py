"""Alarm commands of people, from the panel or the command line; each goes into the audit log."""

from datetime import UTC, datetime

from station.channel.line import CommandDone
from station.channel.panel import (
    AcknowledgeAlarm,
    AlarmAction,
    AlarmList,
    ListAlarms,
    ListedAlarm,
    ShelveAlarm,
    UnshelveAlarm,
)
from station.channel.server import Handlers
from station.errors import BadInputError
from station.inspection.alarm_table import ALARMS, AlarmId, anchor
from station.inspection.alarms import ACTIVE, LONGEST_SHELVED_S, SHELVES, Alarm, AlarmState
from station.messages import alarm_commands as messages
from station.messages.message import Message
from station.records.audit import AuditEntry, validate_entry
from station.runtime.alarms.manager import AlarmManager
from station.runtime.observability.audit_logger import AlarmChange, AuditLogger, alarm_entry


class AlarmCommands:
    """Handlers of alarm requests."""

    def __init__(self, alarms: AlarmManager, audit: AuditLogger) -> None:
        self._alarms, self._audit = alarms, audit
        self.handlers: Handlers = {
            ListAlarms: self.list_alarms,
            AcknowledgeAlarm: self.acknowledge,
            ShelveAlarm: self.shelve,
            UnshelveAlarm: self.unshelve,
        }
        """For a channel's server."""

    async def list_alarms(self, _request: ListAlarms) -> AlarmList:
        """List the alarms that are not in their normal state."""
        return AlarmList(alarms=self.listed())

    def listed(self) -> tuple[ListedAlarm, ...]:
        """Return the alarms that are not in their normal state, most urgent first."""
        return tuple(_listed(alarm) for alarm in self._alarms.alarms.not_normal)

    async def acknowledge(self, request: AcknowledgeAlarm) -> CommandDone:
        """Acknowledge an alarm.

        Raises:
            BadInputError: there is no such alarm.
            BadRecordError: the audit log cannot store the name or the role.
        """
        alarm, entry = self._checked(request, "acknowledged")
        if self._alarms.alarms.get(alarm).state is AlarmState.NORMAL:
            return _refused(messages.NORMAL(alarm=alarm))
        return self._done(self._alarms.acknowledge(alarm), entry)

    async def shelve(self, request: ShelveAlarm) -> CommandDone:
        """Shelve an alarm for a time.

        Raises:
            BadInputError: there is no such alarm.
            BadRecordError: the audit log cannot store the name, the role or the reason.
        """
        alarm, entry = self._checked(request, "shelved", request.reason)
        known = self._alarms.alarms.get(alarm)
        if not request.reason.strip():
            return _refused(messages.REASON_NEEDED())
        if request.for_s > LONGEST_SHELVED_S:
            return _refused(messages.TOO_LONG(asked_s=request.for_s, limit_s=LONGEST_SHELVED_S))
        if ALARMS[alarm].latched:
            return _refused(messages.LATCHED(alarm=alarm))
        if known.shelved_until_s is not None:
            until = datetime.fromtimestamp(known.shelved_until_s, UTC).strftime("%H:%M UTC")
            return _refused(messages.SHELVED_ALREADY(alarm=alarm, until=until, who=known.shelved_by or "?"))
        return self._done(self._alarms.shelve(alarm, request.for_s, request.who, request.reason), entry)

    async def unshelve(self, request: UnshelveAlarm) -> CommandDone:
        """Unshelve an alarm.

        Raises:
            BadInputError: there is no such alarm.
            BadRecordError: the audit log cannot store the name or the role.
        """
        alarm, entry = self._checked(request, "unshelved")
        return self._done(self._alarms.unshelve(alarm), entry)

    def _checked(self, request: AlarmAction, change: AlarmChange, reason: str = "") -> tuple[AlarmId, AuditEntry]:
        """Return the alarm and its audit entry, which is validated before anything changes."""
        if request.alarm not in set(AlarmId):
            raise BadInputError(messages.UNKNOWN(alarm=repr(request.alarm), example=AlarmId.DISK_LOW))
        entry = alarm_entry(request.who, request.role, change, request.alarm, reason)
        validate_entry(entry)
        return AlarmId(request.alarm), entry

    def _done(self, changed: bool, entry: AuditEntry) -> CommandDone:  # noqa: FBT001 (an answer handed on)
        if changed:
            self._audit.log(entry)
        return CommandDone(done=True, why=None)


def _refused(why: Message) -> CommandDone:
    return CommandDone(done=False, why=why)


def _listed(alarm: Alarm) -> ListedAlarm:
    row, shelved = ALARMS[alarm.id], alarm.state in SHELVES
    until_s = alarm.shelved_until_s if shelved else None
    return ListedAlarm(
        alarm=alarm.id,
        number=row.number,
        priority=row.priority.value,
        state=alarm.state,
        active=alarm.state in ACTIVE,
        latched=row.latched,
        detail=alarm.detail,
        since_utc_ms=round(1000 * alarm.since_s),
        raised=alarm.raised,
        cause=row.cause,
        consequence=row.consequence,
        action=row.action,
        document=anchor(alarm.id),
        shelved_until_utc_ms=None if until_s is None else round(1000 * until_s),
        shelved_by=alarm.shelved_by if shelved else "",
    )
