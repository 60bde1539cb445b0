"""History requests of the pages, answered from the records."""

import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from station.channel.messages import ChannelMessage
from station.channel.panel_queries import (
    AuditRows,
    AuditRowView,
    Chunk,
    CurvePointView,
    EndJob,
    EndLot,
    FindInspections,
    GetInspection,
    GetJob,
    ImageView,
    InspectionPage,
    InspectionRow,
    InspectionView,
    JobView,
    ListLots,
    Lots,
    LotView,
    ReadAudit,
    ReadJobFile,
    Search,
    StartExport,
    StartLot,
    StartLotReport,
)
from station.channel.server import Handler
from station.errors import StationError
from station.messages import jobs as messages
from station.records.audit import AuditEntry
from station.records.audit_report import read_audit
from station.records.database import reading
from station.records.lots import Lot, end_lot, read_lots, start_lot
from station.records.model import FullRecord
from station.records.queries import Summary, read_inspection
from station.records.records import Records
from station.records.search import Query, find_page
from station.runtime.rpc.jobs import PanelJobs
from station.runtime.rpc.worker import PanelWorker

_LONGEST_AUDIT_VALUE = 2000


class PanelHistory:
    """Requests about inspections, lots and the audit trail, and exports of them.

    Args:
        worker: runs what blocks.
        jobs: runs what takes long.
    """

    def __init__(self, records: Records, worker: PanelWorker, jobs: PanelJobs) -> None:
        self._records, self._worker, self._jobs = records, worker, jobs
        self._folder = records.folder

    def handlers(self) -> dict[type[ChannelMessage], Handler]:
        """Return the handler of each request."""
        return {
            FindInspections: self.find,
            GetInspection: self.inspection,
            ListLots: self.lots,
            StartLot: self.start_lot,
            EndLot: self.end_lot,
            ReadAudit: self.audit,
            StartExport: self.start_export,
            StartLotReport: self.start_report,
            GetJob: self.job,
            EndJob: self.end_job,
            ReadJobFile: self.read_file,
        }

    async def find(self, request: FindInspections) -> InspectionPage:
        """Return one page of a search, newest first."""
        return await self._worker.do(lambda: self._find(request))

    async def inspection(self, request: GetInspection) -> InspectionView:
        """Return one inspection in full."""

        def read() -> InspectionView:
            with reading(self._folder) as connection:
                return _inspection_view(read_inspection(connection, request.sequence, self._folder))

        return await self._worker.do(read)

    async def lots(self, request: ListLots) -> Lots:
        """List the last lots."""

        def read() -> Lots:
            with reading(self._folder) as connection:
                return Lots(lots=tuple(map(_lot, read_lots(connection, request.limit, name=request.name))))

        return await self._worker.do(read)

    async def start_lot(self, request: StartLot) -> LotView:
        """Store a lot's start with its audit entry."""
        lot = await self._records.change(lambda connection: start_lot(connection, request.name, request.grower))
        await self._note(request, "lot.told", {"grower": lot.grower})
        return _lot(lot)

    async def end_lot(self, request: EndLot) -> LotView:
        """Store a lot's end with its audit entry."""
        lot = await self._records.change(lambda connection: end_lot(connection, request.name))
        await self._note(request, "lot.ended", {"ended_utc_ms": lot.ended_utc_ms})
        return _lot(lot)

    async def audit(self, request: ReadAudit) -> AuditRows:
        """List the last rows of the audit trail."""

        def read() -> AuditRows:
            with reading(self._folder) as connection:
                rows = read_audit(connection, request.limit, request.action, request.subject)[::-1]
            told = (
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
            return AuditRows(rows=tuple(told))

        return await self._worker.do(read)

    async def start_export(self, request: StartExport) -> JobView:
        """Start an export of inspections as a table."""
        folder = self._jobs.folder()
        target = folder / f"inspections.{request.form}"
        await self._note(request, "records.exported", request.search.model_dump(mode="json", exclude_none=True))
        return self._jobs.begin("export", folder, ["records", "export", str(target), *_options(request.search)])

    async def start_report(self, request: StartLotReport) -> JobView:
        """Start a lot's report."""
        _check_text(request.lot)
        folder = self._jobs.folder()
        arguments = ["records", "report", "--", request.lot, str(folder / "lot.html")]
        return self._jobs.begin("lot_report", folder, arguments)

    async def job(self, request: GetJob) -> JobView:
        """Return a job's state."""
        return self._jobs.state(request.job)

    async def end_job(self, request: EndJob) -> JobView:
        """Cancel a job."""
        return await self._jobs.end(request.job)

    async def read_file(self, request: ReadJobFile) -> Chunk:
        """Return a part of a job's file."""
        return await self._worker.do(lambda: self._jobs.read(request.job, request.name, request.offset))

    async def _note(self, request: StartLot | EndLot | StartExport, action: str, new: object) -> None:
        subject = "records" if isinstance(request, StartExport) else f"lot {request.name}"
        await self._records.audit(AuditEntry(request.actor.who, request.actor.role, action, subject, new=new))

    def _find(self, request: FindInspections) -> InspectionPage:
        search = request.search
        query = Query(
            search.lot,
            search.grower,
            search.from_utc_ms,
            search.to_utc_ms,
            search.outcome,
            search.reason,
            search.fruit,
        )
        with reading(self._folder) as connection:
            page = find_page(connection, query, request.limit, request.below)
        return InspectionPage(rows=tuple(map(_row, page.rows)), below=page.below)


def _row(row: Summary) -> InspectionRow:
    return InspectionRow.model_validate({**row._asdict(), "areas_mm2": row.areas_mm2})


def _lot(lot: Lot) -> LotView:
    return LotView(**lot._asdict())


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


def _options(search: Search) -> list[str]:
    """Return a search as options of the command line."""
    given = {
        "lot": search.lot,
        "grower": search.grower,
        "outcome": search.outcome,
        "reason": search.reason,
        "fruit": search.fruit,
        "from": None if search.from_utc_ms is None else _iso(search.from_utc_ms),
        "to": None if search.to_utc_ms is None else _iso(search.to_utc_ms),
    }
    chosen = {name: str(value) for name, value in given.items() if value is not None}
    for value in chosen.values():
        _check_text(value)
    return [f"--{name}={value}" for name, value in chosen.items()]


def _iso(utc_ms: int) -> str:
    try:
        return datetime.fromtimestamp(utc_ms / 1000, UTC).isoformat()
    except (ValueError, OverflowError) as error:
        raise StationError(messages.NO_TIME(utc_ms=utc_ms)) from error


def _check_text(text: str) -> None:
    if not text.isprintable():
        raise StationError(messages.UNPRINTABLE(text=repr(text)))
