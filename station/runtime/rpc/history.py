"""Requests of the pages that change lots, and that note exports."""

from station.channel.line import Noted
from station.channel.panel_queries import EndLot, LotView, NoteExport, StartLot
from station.channel.server import Handlers
from station.records.audit import AuditEntry
from station.records.lots import end_lot, start_lot
from station.records.records import Records


class PanelHistory:
    """Requests to begin and end lots, and to note exports."""

    def __init__(self, records: Records) -> None:
        self._records = records
        self.handlers: Handlers = {
            StartLot: self.start_lot,
            EndLot: self.end_lot,
            NoteExport: self.note_export,
        }

    async def start_lot(self, request: StartLot) -> LotView:
        """Store a lot's start with its audit entry."""
        lot = await self._records.change(lambda connection: start_lot(connection, request.name, request.grower))
        await self._note(request, "lot.told", {"grower": lot.grower})
        return lot

    async def end_lot(self, request: EndLot) -> LotView:
        """Store a lot's end with its audit entry."""
        lot = await self._records.change(lambda connection: end_lot(connection, request.name))
        await self._note(request, "lot.ended", {"ended_utc_ms": lot.ended_utc_ms})
        return lot

    async def note_export(self, request: NoteExport) -> Noted:
        """Store the audit entry of an export."""
        await self._note(request, "records.exported", request.search.model_dump(mode="json", exclude_none=True))
        return Noted()

    async def _note(self, request: StartLot | EndLot | NoteExport, action: str, new: object) -> None:
        subject = "records" if isinstance(request, NoteExport) else f"lot {request.name}"
        await self._records.audit(AuditEntry(request.actor.who, request.actor.role, action, subject, new=new))
