"""Outbox monitor: checks by the outbox's status that other systems are up to date."""

import time
from pathlib import Path

from station.messages import outbox as messages
from station.messages.message import Message, joined
from station.outbox.status import DestinationStatus, outbox_folder, read_status
from station.settings.outbox import OutboxSettings

LOST_S = 30.0
"""A process that writes no status for so long does not run."""


class OutboxMonitor:
    """Delay of the outbox."""

    def __init__(self, settings: OutboxSettings, home: Path) -> None:
        self._settings, self._folder = settings, outbox_folder(home)
        self._enabled = settings.postgresql.enabled or settings.mqtt.enabled
        self._seen_utc_ms: int | None = None
        self._changed_s = time.monotonic()

    def alarm_detail(self) -> Message | None:
        """Return what is delayed; None for nothing, and if no destination is enabled."""
        if not self._enabled:
            return None
        status, now_s = read_status(self._folder), time.time()
        # By the monotonic clock: after a clock was set back, the last status of a lost process would be a new one.
        if status is not None and status.utc_ms != self._seen_utc_ms:
            self._seen_utc_ms, self._changed_s = status.utc_ms, time.monotonic()
        silent_s = time.monotonic() - self._changed_s
        if silent_s > LOST_S:
            return messages.SILENT(age_s=silent_s)
        # The status of an earlier start does not count.
        destinations = {} if status is None or status.age_s > LOST_S else status.destinations
        late = [found for name, each in destinations.items() if (found := self._late(name, each, now_s)) is not None]
        return joined(late) if late else None

    def _late(self, name: str, each: DestinationStatus, now_s: float) -> Message | None:
        since_utc_ms = each.waiting_since_utc_ms
        age_s = 0.0 if since_utc_ms is None else now_s - since_utc_ms / 1000
        if age_s <= self._settings.alarm_after_s and (each.waiting or 0) <= self._settings.alarm_after_rows:
            return None
        if each.waiting is None:
            late = messages.WAITING_UNKNOWN(destination=name, age_s=age_s)
        else:
            late = messages.WAITING(destination=name, number=each.waiting, age_s=age_s)
        return messages.LATE_BECAUSE(late=late, error=each.error) if each.error else late
