"""Inspections, lots, audit trail, pictures and support bundle, read from the records by this process.

Nothing here reaches the station: a page that searches millions of rows, or measures a stored image again, costs the
cycle nothing but a share of the processor.
"""

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Self

import cv2

from hmi.past.pictures import read_image, read_stages
from hmi.past.recipes import PastRecipes
from hmi.past.tried import Tried, read_tried
from station.channel.panel_queries import (
    AuditRowView,
    CurvePointView,
    ImageView,
    InspectionPage,
    InspectionRow,
    InspectionView,
    LotView,
    Picture,
    Search,
    Stages,
)
from station.channel.worker import PanelBusyError, PanelWorker
from station.records.audit_report import read_audit
from station.records.database import reading
from station.records.errors import RecordsError, UnknownInspectionError
from station.records.lots import read_lots
from station.records.model import FullRecord
from station.records.queries import Summary, read_inspection
from station.records.search import Query, find_page
from station.settings.configuration import Configuration
from station.settings.recipe_model import Recipe
from station.support.bundle import bundle

__all__ = ["PanelBusyError", "Past", "RecordsError", "Tried", "UnknownInspectionError"]

_LONGEST_AUDIT_VALUE = 2000


class Past:
    """Reader of the records.

    Each method raises `RecordsError` if they cannot be read, and `PanelBusyError` if too many wait or one takes 20 s.

    Args:
        site: the configuration in force.
    """

    def __init__(self, site: Configuration) -> None:
        self._site, self._folder, self._worker = site, site.home / "records", PanelWorker()
        self.recipes = PastRecipes(site.home, site.recipes_folder, self._worker)

    def __enter__(self) -> Self:
        cv2.setNumThreads(1)  # a page that measures an image must leave the other cores to the cycle
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.close()

    async def find(self, search: Search, limit: int, below: int | None = None) -> InspectionPage:
        """Return one page of a search, newest first.

        Args:
            below: of the page before; None for the first.
        """
        query = Query(
            search.lot,
            search.grower,
            search.from_utc_ms,
            search.to_utc_ms,
            search.outcome,
            search.reason,
            search.fruit,
        )

        def read() -> InspectionPage:
            with reading(self._folder) as connection:
                page = find_page(connection, query, limit, below)
            return InspectionPage(rows=tuple(map(_row, page.rows)), below=page.below)

        return await self._worker.do(read)

    async def inspection(self, sequence: int) -> InspectionView:
        """Return one inspection in full.

        Raises:
            UnknownInspectionError: there is no record of it.
        """

        def read() -> InspectionView:
            with reading(self._folder) as connection:
                return _inspection_view(read_inspection(connection, sequence, self._folder))

        return await self._worker.do(read)

    async def lots(self, limit: int = 20, name: str | None = None) -> tuple[LotView, ...]:
        """Return the latest lots, newest first, or the one of a name."""

        def read() -> tuple[LotView, ...]:
            with reading(self._folder) as connection:
                return tuple(LotView(**lot._asdict()) for lot in read_lots(connection, limit, name=name))

        return await self._worker.do(read)

    async def audit(self, limit: int, action: str = "", subject: str = "") -> tuple[AuditRowView, ...]:
        """Return the latest rows of the audit trail, newest first.

        Args:
            action: of this action, or of all that begin so.
            subject: with this text in their subject.
        """

        def read() -> tuple[AuditRowView, ...]:
            with reading(self._folder) as connection:
                rows = read_audit(connection, limit, action, subject)[::-1]
            return tuple(
                AuditRowView(
                    seq=row.seq,
                    utc_ms=row.utc_ms,
                    who=row.who,
                    role=row.role,
                    action=row.action,
                    subject=row.subject,
                    reason=row.reason,
                    old=(row.old or "")[:_LONGEST_AUDIT_VALUE],
                    new=(row.new or "")[:_LONGEST_AUDIT_VALUE],
                )
                for row in rows
            )

        return await self._worker.do(read)

    async def image(self, sha256: str) -> Picture:
        """Return one stored image."""
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
            bundle(self._site, file)
            return file.getvalue()

        return await self._worker.do(write)


def _row(row: Summary) -> InspectionRow:
    return InspectionRow.model_validate({**row._asdict(), "areas_mm2": row.areas_mm2})


def _inspection_view(record: FullRecord) -> InspectionView:
    trigger, judged, standing, recipe = record.trigger, record.judged, record.standing, record.trigger.recipe
    return InspectionView(
        sequence=record.sequence,
        trigger_id=trigger.trigger_id,
        encoder=trigger.encoder,
        lot=trigger.lot,
        began_utc_ms=trigger.began_utc_ms,
        simulated=trigger.simulated,
        standing=standing,
        judged=judged.outcome if judged else None,
        reasons=tuple(map(str, standing.reasons)) if standing is not None else (),
        explanation=judged.explanation if judged else (),
        judgement=judged.judgement if judged else None,
        first_press_findings=judged.first_press_findings if judged else None,
        curve=tuple(
            CurvePointView(**{name: value for name, value in asdict(point).items() if name != "captured_s"})
            for point in (judged.curve if judged else ())
        ),
        recipe_name=recipe.name if recipe else "",
        recipe_revision=recipe.revision if recipe else "",
        recipe_sha256=recipe.sha256 if recipe else "",
        recipe=json.loads(recipe.text) if recipe else None,
        phases_s=dict(judged.phases_s) if judged else {},
        measures=dict(judged.measures) if judged else {},
        devices=dict(judged.devices) if judged else {},
        versions=dict(judged.versions) if judged else {},
        images=tuple(
            ImageView(kind=image.kind, step=image.step, sha256=image.sha256, there=Path(image.path).is_file())
            for image in record.images
        ),
        images_state=record.images_state,
        published_utc_ms=record.published_utc_ms,
        acknowledged_utc_ms=record.acknowledged_utc_ms,
        fruit_length_mm=trigger.size.length_mm,
        size_class=trigger.size.size_class,
    )
