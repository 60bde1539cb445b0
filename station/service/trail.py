"""What is to go into the audit trail, on its way there: told at once, written behind, tried again until it is."""

import asyncio
import logging
from typing import Any

from station.channel.line import Command, CommandDone
from station.records.audit import AuditEntry
from station.records.errors import BadRecordError, RecordsError
from station.records.records import Records

PLC = "plc"
PANEL = "panel"
"""Who acts where the one at the panel is not known by name."""
RETRY_S = 2.0
FLUSH_S = 3.0
MOST_WAITING = 10_000

log = logging.getLogger(__name__)


class Trail:
    """The station's own way into the audit trail. `note` never waits; nothing that it is told is left out silently.

    Args:
        records: opened, or to be opened again.
    """

    def __init__(self, records: Records) -> None:
        self._records = records
        self._waiting: list[AuditEntry] = []
        self._told = asyncio.Event()
        self._writing = asyncio.Lock()

    def note(self, *entries: AuditEntry) -> None:
        """Have something written.

        Args:
            entries: in their order.
        """
        self._waiting += entries
        if len(self._waiting) > MOST_WAITING:
            log.error("the audit trail loses its oldest unwritten row: %s", self._waiting.pop(0))
        self._told.set()

    def command(self, who: str, command: str, subject: str, why_not: str, role: str = "", **old: Any) -> None:
        """Note a command that was carried out, or refused.

        Args:
            who: `plc`, `panel` or a person's name.
            command: its name.
            subject: what it is about.
            why_not: why it was not carried out; empty where it was.
            role: in what capacity; as `who` where none is given.
            old: what was before, where that tells something.
        """
        new = {"done": not why_not} | ({"why": why_not} if why_not else {})
        self.note(AuditEntry(who, role or who, f"command.{command}", subject, "", old or None, new))

    async def keep(self) -> None:
        """Write what is told, until cancelled."""
        while True:
            await self._told.wait()
            self._told.clear()
            if not await self._write():
                await asyncio.sleep(RETRY_S)
                self._told.set()

    async def flush(self) -> None:
        """Write what waits, once; what cannot be written is logged."""
        if not await self._write():
            log.error("the audit trail could not take: %s", "; ".join(map(str, self._waiting)))

    async def _write(self) -> bool:
        async with self._writing:
            while self._waiting:
                entry = self._waiting[0]
                try:
                    await self._records.audit(entry)
                except BadRecordError:
                    log.exception("the audit trail cannot hold %s", entry)
                except RecordsError as error:
                    log.warning("the audit trail waits: %s", error)
                    return False
                del self._waiting[0]
            return True


def order_told(command: Command, done: CommandDone, old: Any, by: tuple[str, str]) -> AuditEntry:
    """What the trail says of a command of the PLC's, or the same of a person's.

    Args:
        command: as it came.
        done: what came of it.
        old: what was before; None where nothing tells.
        by: who gave it, and in what role.
    """
    new = {"argument": command.argument, **done.model_dump()}
    return AuditEntry(*by, f"command.{command.command}", "station", "", old, new)


def calibration_stored(who: str, reason: str, subject: str, old: Any, new: Any) -> AuditEntry:
    """What the trail says of a calibration; for `Records.audit`, or `append_audit` where no station runs.

    Args:
        who: the person who made it.
        reason: why, as `yearly`, `gel changed`.
        subject: what was calibrated, as `scale of DIGIT D20966`.
        old: what was in force before, None for nothing.
        new: what is from now on.
    """
    return AuditEntry(who, "service", "calibration.stored", subject, reason, old, new)


def calibration_verified(who: str, subject: str, calibration: str, verification: str, *, passed: bool) -> AuditEntry:
    """What the trail says of a verification.

    Args:
        who: the person who made it.
        subject: what was verified, as `sensor D20966`.
        calibration: the id of what it was compared with.
        verification: its own id.
        passed: whether all was within its tolerance.
    """
    new = {"calibration": calibration, "verification": verification, "passed": passed}
    return AuditEntry(who, "service", "calibration.verified", subject, "", None, new)


def alarm_changed(who: str, role: str, change: str, alarm: str, reason: str = "") -> AuditEntry:
    """What the trail says of a person's or the PLC's hand on an alarm.

    Args:
        who: `plc`, `panel` or a person's name.
        role: in what capacity.
        change: `acknowledged`, `shelved`, `unshelved` or `reset`.
        alarm: its id.
        reason: why, as for shelving.
    """
    return AuditEntry(who, role, f"alarm.{change}", f"alarm {alarm}", reason)
