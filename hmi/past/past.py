"""Inspections, lots, audit trail, pictures and support bundle, read from the records by this process.

Nothing here reaches the station: a page that searches millions of rows, or measures a stored image again, costs the
cycle nothing but a share of the processor.
"""

import io
import os
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Self, TypeVar

import cv2
from sqlalchemy import Connection

from hmi.past.pictures import Stages, read_image, read_stages
from hmi.past.recipes import PastRecipes
from hmi.past.tried import Tried, read_tried
from hmi.past.worker import PastWorker
from station.channel.panel_lots import LotView, Search
from station.channel.worker import PanelBusyError
from station.inspection.alarm_table import ALARMS
from station.messages.message import Message, message_in, verbatim
from station.records.audit import AuditRow
from station.records.audit_report import read_audit
from station.records.database import reading, records_folder
from station.records.errors import RecordsError, UnknownInspectionError
from station.records.lots import read_lots
from station.records.model import AlarmEntry, FullRecord, InspectionRecord
from station.records.queries import read_alarm_log, read_inspection
from station.records.search import Page, Query, find_page
from station.settings.configuration import Configuration
from station.settings.recipe_model import Recipe
from station.support.bundle import bundle

T = TypeVar("T")
_ALARM_ROWS = {str(alarm): row for alarm, row in ALARMS.items()}

__all__ = [
    "AuditRow",
    "FullRecord",
    "Page",
    "PanelBusyError",
    "Past",
    "RecordsError",
    "Stages",
    "Tried",
    "UnknownInspectionError",
    "judged_of",
]


class AlarmChange(NamedTuple):
    """One change of one alarm."""

    utc_ms: int
    number: int | None
    """None for an alarm of another version."""
    cause: Message
    change: str
    detail: Message | None


class Past:
    """Reader of the records.

    Each method raises `RecordsError` if they cannot be read, and `PanelBusyError` if too many wait or one takes 20 s.

    Args:
        broken: the error in the configuration's files, where `site` is the last good one; empty for none.
    """

    def __init__(self, site: Configuration, broken: str) -> None:
        self._site, self._broken, self._folder = site, broken, records_folder(site.home)
        self._worker = PastWorker()
        self.recipes = PastRecipes(site.home, site.recipes_folder, self._worker)

    def __enter__(self) -> Self:
        cv2.setNumThreads(1)  # a page that measures an image must leave the other cores to the cycle
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.close()

    async def find(self, search: Search, limit: int, below: int | None = None) -> Page:
        """Return one page of a search, newest first; the first one, or that below a number."""
        return await self._read(lambda connection: find_page(connection, Query(**dict(search)), limit, below))

    async def inspection(self, sequence: int) -> FullRecord:
        """Return one inspection in full, with those of its images whose files still exist.

        Raises:
            UnknownInspectionError: there is no record of it.
        """

        def read(connection: Connection) -> FullRecord:
            record = read_inspection(connection, sequence, self._folder)
            return replace(record, images=tuple(image for image in record.images if os.path.isfile(image.path)))

        return await self._read(read)

    async def lots(self, limit: int = 20, name: str | None = None) -> list[LotView]:
        """Return the latest lots, newest first, or the one of a name."""
        return await self._read(lambda connection: read_lots(connection, limit, name=name))

    async def audit(
        self, limit: int, action: str = "", subject: str = "", below: int | None = None
    ) -> tuple[list[AuditRow], int | None]:
        """Return a page of the rows of actions that begin so and whose subject has this text, newest first.

        Returns:
            The rows, and the number that the next page is below; None if this is the last.
        """
        found = await self._read(lambda connection: read_audit(connection, limit + 1, action, subject, below)[::-1])
        return found[:limit], found[limit - 1].seq if len(found) > limit else None

    async def alarm_changes(self, limit: int, below: int | None = None) -> tuple[list[AlarmChange], int | None]:
        """Return a page of the changes of alarms, newest first.

        Returns:
            The changes, and the number that the next page is below; None if this is the last.
        """
        found = await self._read(lambda connection: read_alarm_log(connection, limit + 1, below))
        numbers, changes = list(found), [_alarm_change(entry) for entry in found.values()]
        return changes[:limit], numbers[limit - 1] if len(numbers) > limit else None

    async def image(self, sha256: str) -> bytes:
        """Return one stored image, a PNG file."""
        return await self._worker.do(lambda: read_image(self._folder, sha256))

    async def stages(self, sequence: int, step: int) -> Stages:
        """Measure one step's stored image again, and return the measurement's stages."""
        return await self._worker.do(lambda: read_stages(self._folder, sequence, step))

    async def tried(self, draft: Recipe) -> Tried | None:
        """Return what a draft would have decided on past fruit; None before the first."""
        return await self._worker.do(lambda: read_tried(self._folder, draft))

    async def support_bundle(self) -> bytes:
        """Return what `station support` writes, a ZIP file."""

        def write() -> bytes:
            file = io.BytesIO()
            bundle(self._site, self._broken, file)
            return file.getvalue()

        return await self._worker.do(write)

    async def _read(self, query: Callable[[Connection], T]) -> T:
        def read() -> T:
            with reading(self._folder) as connection:
                return query(connection)

        return await self._worker.do(read)


def _alarm_change(entry: AlarmEntry) -> AlarmChange:
    row = _ALARM_ROWS.get(entry.id)
    number, cause = (row.number, row.cause) if row else (None, verbatim(entry.id))
    return AlarmChange(entry.utc_ms, number, cause, entry.change, message_in(entry.detail))


def judged_of(record: FullRecord) -> InspectionRecord:
    """Return an inspection's result; an empty one where the station was lost before."""
    return record.judged or _LOST


_LOST = InspectionRecord(
    outcome="NO_RESULT",
    reasons=(),
    explanation=(),
    late=False,
    partial=False,
    area_mm2=None,
    area_px=None,
    closing_mm=None,
    confidence=None,
    ended_utc_ms=0,
    duration_ms=0,
)
