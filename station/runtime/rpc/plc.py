"""Channel server for the PLC interface: answers its requests and the commands of people at the cell."""

import logging

from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    Line,
    Noted,
    Open,
    Outcome,
    Published,
    Resume,
    StationState,
)
from station.channel.panel import Recover
from station.channel.server import Handlers, is_expired
from station.messages.operation import TRIGGER_GIVEN_UP
from station.runtime.alarms.commands import AlarmCommands
from station.runtime.production.production import Production
from station.vocabulary import Refusal

log = logging.getLogger(__name__)


class PlcInterfaceServer:
    """Channel server for the PLC interface."""

    def __init__(self, production: Production, alarms: AlarmCommands) -> None:
        self._service, self._line_state = production.service, production.line_state
        self._interlock, self._lots = production.interlock, production.lots
        self.handlers: Handlers = {
            Begin: self._begin,
            AwaitOutcome: self._outcome,
            Published: self._published,
            Acknowledged: self._acknowledged,
            Resume: self._resume,
            Line: self._line,
            Command: production.plc_commands.execute,
            Recover: production.plc_commands.recover,
            **alarms.handlers,
        }

    async def _begin(self, request: Begin) -> BeginReply:
        refusal, _ = self._interlock.refusal()
        lot = self._lots.lot_of(request.lot)
        if refusal is None and not await self._lots.begin(lot):
            refusal = Refusal.NOT_READY
        refusal = refusal or self._interlock.refusal()[0]  # the mode may have changed while the lot began
        # The PLC has read a refusal where the answer comes too late, and may move the fruit.
        if is_expired():
            refusal = Refusal.STATION_LOST
        begun = await self._service.begin(request, refusal, lot)
        if is_expired():
            log.warning("trigger %d was answered too late: the PLC has read that it is refused", request.trigger_id)
            if begun.sequence is not None:
                self._service.abort(begun.sequence, TRIGGER_GIVEN_UP())
        return begun

    async def _outcome(self, request: AwaitOutcome) -> Outcome:
        return await self._service.registry.outcome(request.sequence)

    async def _published(self, request: Published) -> Noted:
        await self._service.published(request.outcome)
        return Noted()

    async def _acknowledged(self, request: Acknowledged) -> Noted:
        await self._service.registry.records.acknowledged(request.sequence)
        return Noted()

    async def _resume(self, _request: Resume) -> Open:
        return await self._service.registry.open_inspections()

    async def _line(self, request: Line) -> StationState:
        self._line_state.report(request)
        return self._interlock.state()
