"""Requests of the pages that change lots, and that export from the records."""

from datetime import UTC, datetime

from station.channel.messages import ChannelMessage
from station.channel.panel_queries import (
    EndJob,
    EndLot,
    GetJob,
    JobView,
    LotView,
    Search,
    StartExport,
    StartLot,
    StartLotReport,
)
from station.channel.server import Handler
from station.channel.worker import PanelWorker
from station.errors import StationError
from station.messages import jobs as messages
from station.records.audit import AuditEntry
from station.records.lots import end_lot, start_lot
from station.records.records import Records
from station.runtime.rpc.jobs import PanelJobs


class PanelHistory:
    """Requests to begin and end lots, and to export inspections.

    Args:
        worker: runs what blocks.
        jobs: runs what takes long.
    """

    def __init__(self, records: Records, worker: PanelWorker, jobs: PanelJobs) -> None:
        self._records, self._worker, self._jobs = records, worker, jobs

    def handlers(self) -> dict[type[ChannelMessage], Handler]:
        """Return the handler of each request."""
        return {
            StartLot: self.start_lot,
            EndLot: self.end_lot,
            StartExport: self.start_export,
            StartLotReport: self.start_report,
            GetJob: self.job,
            EndJob: self.end_job,
        }

    async def start_lot(self, request: StartLot) -> LotView:
        """Store a lot's start with its audit entry."""
        lot = await self._records.change(lambda connection: start_lot(connection, request.name, request.grower))
        await self._note(request, "lot.told", {"grower": lot.grower})
        return LotView(**lot._asdict())

    async def end_lot(self, request: EndLot) -> LotView:
        """Store a lot's end with its audit entry."""
        lot = await self._records.change(lambda connection: end_lot(connection, request.name))
        await self._note(request, "lot.ended", {"ended_utc_ms": lot.ended_utc_ms})
        return LotView(**lot._asdict())

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

    async def _note(self, request: StartLot | EndLot | StartExport, action: str, new: object) -> None:
        subject = "records" if isinstance(request, StartExport) else f"lot {request.name}"
        await self._records.audit(AuditEntry(request.actor.who, request.actor.role, action, subject, new=new))


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
