"""Looks at the last outcomes together: what one fruit cannot tell."""

from collections import deque

from station.channel.line import Outcome
from station.inspection.alarm_table import AlarmId
from station.service.alarm_desk import AlarmDesk
from station.vocabulary import OutcomeName

_LAST = 20
_MANY = 5


class OutcomeWatch:
    """The last outcomes that the PLC was told.

    Args:
        alarms: told of many that could not be judged, or were rejected.
    """

    def __init__(self, alarms: AlarmDesk) -> None:
        self._alarms = alarms
        self._last: deque[OutcomeName] = deque(maxlen=_LAST)

    def saw(self, outcome: Outcome) -> None:
        """Take one more into account.

        Args:
            outcome: as told.
        """
        self._last.append(outcome.outcome)
        last = list(self._last)
        unjudged = last[-_MANY:] == ["NO_RESULT"] * _MANY
        self._alarms.show(AlarmId.MANY_NO_RESULT, f"the last {_MANY} fruit could not be judged" if unjudged else "")
        failed = last.count("FAIL")
        many = failed > _LAST / 2
        self._alarms.show(AlarmId.REJECT_RATE, f"{failed} of the last {len(last)} fruit failed" if many else "")
