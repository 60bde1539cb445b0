"""Audit logger: queues audit entries, writes them in the background, and tries again until they are stored."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any, Literal, TypeAlias

from station.channel.line import Command, CommandDone
from station.messages.message import Message
from station.records.audit import AuditEntry
from station.records.errors import BadRecordError, RecordsError
from station.records.records import Records

PLC = "plc"
PANEL = "panel"
"""Actor of a command from a panel without a logged-in person."""
RETRY_S = 2.0
"""Pause before entries that could not be written are tried again, s: an estimate."""
FLUSH_S = 3.0
"""Longest wait for the last entries at the process's end, s: an estimate."""
MOST_WAITING = 10_000
"""Entries in memory while the records cannot be written; beyond it the oldest are lost: an estimate."""

AlarmChange: TypeAlias = Literal["acknowledged", "shelved", "unshelved", "reset"]

log = logging.getLogger(__name__)


class AuditLogger:
    """Queue of audit entries. `log` never waits; no entry is dropped silently."""

    def __init__(self, records: Records) -> None:
        self._records = records
        self._waiting: list[AuditEntry] = []
        self._under_way: tuple[AuditEntry, asyncio.Future[Any]] | None = None
        """Entry that the records are writing: it goes on when its waiter is cancelled, and is never written again."""
        self._queued = asyncio.Event()
        self._writing = asyncio.Lock()
        self._on_stored: list[tuple[AuditEntry, Callable[[], Awaitable[object]]]] = []

    def log(self, *entries: AuditEntry, on_stored: Callable[[], Awaitable[object]] | None = None) -> None:
        """Queue entries to be written; `on_stored` is called once the trail has the last of them."""
        self._waiting += entries
        if on_stored is not None:
            self._on_stored.append((entries[-1], on_stored))
        while len(self._waiting) > MOST_WAITING:
            log.error("the audit trail loses its oldest unwritten row: %s", self._waiting.pop(0))
        self._queued.set()

    def log_command(self, by: tuple[str, str], command: str, subject: str, why_not: Message | None) -> None:
        """Queue the entry of a command that was carried out or refused.

        Args:
            by: name and role of who gave it.
            why_not: reason of the refusal; None if it was carried out.
        """
        new = {"done": why_not is None} | ({} if why_not is None else {"why": str(why_not)})
        self.log(AuditEntry(*by, f"command.{command}", subject, "", None, new))

    async def run(self) -> None:
        """Write the queue until cancelled."""
        while True:
            await self._queued.wait()
            self._queued.clear()
            if not await self._write():
                await asyncio.sleep(RETRY_S)
                self._queued.set()

    async def flush(self) -> None:
        """Write the queue once, for `FLUSH_S` at most; what was not written by then is logged."""
        try:
            async with asyncio.timeout(FLUSH_S):
                written = await self._write()
        except TimeoutError:
            written = False
        if not written:
            under_way = [self._under_way[0]] if self._under_way else []
            log.error("the audit trail could not take: %s", "; ".join(map(str, [*under_way, *self._waiting])))

    async def _write(self) -> bool:
        async with self._writing:
            while self._under_way or self._waiting:
                if self._under_way is None:
                    entry = self._waiting.pop(0)
                    self._under_way = entry, asyncio.ensure_future(self._records.audit(entry))
                entry, writing = self._under_way
                try:
                    await asyncio.shield(writing)
                except BadRecordError:
                    log.exception("the audit trail cannot hold %s", entry)
                except RecordsError as error:
                    log.warning("the audit trail waits: %s", error)
                    self._waiting.insert(0, entry)
                    self._under_way = None
                    return False
                else:
                    await self._report_stored(entry)
                self._under_way = None
            return True

    async def _report_stored(self, entry: AuditEntry) -> None:
        for waiting in [each for each in self._on_stored if each[0] is entry]:
            await waiting[1]()
            self._on_stored.remove(waiting)


def command_entry(command: Command, done: CommandDone, old: Any, by: tuple[str, str]) -> AuditEntry:
    """Make the entry of a command by the name and role of who gave it; `old` is the value before, None if unknown."""
    new = {"argument": command.argument, "done": done.done, "why": str(done.why or "")}
    return AuditEntry(*by, f"command.{command.command}", "station", "", old, new)


def calibration_entry(who: str, reason: str, subject: str, old: Any, new: Any) -> AuditEntry:
    """Make the entry of a calibration; for `Records.audit`, or `append_audit` if no station runs.

    Args:
        reason: as `yearly`, `gel changed`.
        subject: the calibrated thing, as `scale of DIGIT D20966`.
        old: value in force before, None for none.
        new: value in force from now on.
    """
    return AuditEntry(who, "service", "calibration.stored", subject, reason, old, new)


def verification_entry(who: str, subject: str, calibration: str, verification: str, *, passed: bool) -> AuditEntry:
    """Make the entry of a verification, of a subject as `sensor D20966`, against a calibration, by its id."""
    new = {"calibration": calibration, "verification": verification, "passed": passed}
    return AuditEntry(who, "service", "calibration.verified", subject, "", None, new)


def alarm_entry(who: str, role: str, change: AlarmChange, alarm: str, reason: str = "") -> AuditEntry:
    """Make the entry of an alarm that a person or the PLC changed.

    Args:
        who: `plc`, `panel` or a person's name.
        reason: as for shelving.
    """
    return AuditEntry(who, role, f"alarm.{change}", f"alarm {alarm}", reason)
