"""Outcome monitor: raises alarms from the last outcomes together."""

from collections import deque

from station.channel.line import Outcome
from station.inspection.alarm_table import AlarmId
from station.messages import operation as messages
from station.runtime.alarms.manager import AlarmManager
from station.vocabulary import OutcomeName

_LAST = 20
"""Outcomes that the reject rate is taken over: an estimate."""
_MANY = 5
"""NO_RESULT in a row that raise the alarm: an estimate."""


class OutcomeMonitor:
    """Last outcomes that were published to the PLC; raises an alarm if many could not be judged, or were rejected."""

    def __init__(self, alarms: AlarmManager) -> None:
        self._alarms = alarms
        self._last: deque[OutcomeName] = deque(maxlen=_LAST)

    def add(self, outcome: Outcome) -> None:
        """Add one outcome."""
        if not outcome.late:
            self._alarms.clear(AlarmId.DEADLINE_MISSED)
        self._last.append(outcome.outcome)
        last = list(self._last)
        unjudged = last[-_MANY:] == ["NO_RESULT"] * _MANY
        self._alarms.update(AlarmId.MANY_NO_RESULT, messages.MANY_UNJUDGED(number=_MANY) if unjudged else None)
        failed = last.count("FAIL")
        many = failed > _LAST / 2
        self._alarms.update(
            AlarmId.REJECT_RATE, messages.MANY_FAILED(failed=failed, number=len(last)) if many else None
        )
