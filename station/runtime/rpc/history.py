"""Requests of the pages that change lots, and that note exports."""

from station.channel.line import Noted
from station.channel.panel_lots import EndLot, LotView, NoteExport, StartLot
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
        by = request.actor.who, request.actor.role
        return await self._records.change(lambda connection: start_lot(connection, request.name, request.grower, by))

    async def end_lot(self, request: EndLot) -> LotView:
        """Store a lot's end with its audit entry."""
        by = request.actor.who, request.actor.role
        return await self._records.change(lambda connection: end_lot(connection, request.name, by))

    async def note_export(self, request: NoteExport) -> Noted:
        """Store the audit entry of an export."""
        search = request.search.model_dump(mode="json", exclude_none=True)
        entry = AuditEntry(request.actor.who, request.actor.role, "records.exported", "records", new=search)
        await self._records.audit(entry)
        return Noted()
