"""Operator commands from the panel: started at once, followed to their end, shown on all panels, and audited."""

import asyncio
import itertools
import logging
from collections import deque

from sqlalchemy import Connection

from station.channel.line import Command, CommandName
from station.channel.panel import Recover, RecoveryName
from station.channel.panel_run import OperatorCommand, OperatorCommandName, OperatorCommandView
from station.clock import utc_ms
from station.devices.arm.faults import ArmCause, ArmFault
from station.errors import StationError
from station.inspection.cycle import UNJUDGED, WAITING
from station.inspection.states import State
from station.messages import commands as messages
from station.messages import lots
from station.messages.message import Message, message_of
from station.messages.operation import internal_fault
from station.records.errors import RecordsError
from station.records.lots import end_lot, read_lots, start_lot
from station.records.records import Records
from station.runtime.cycle.service import Service
from station.runtime.devices.manager import ARM, DeviceManager
from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.production.lots import LotManager, is_lot_name
from station.runtime.production.plc_commands import MANUAL, PlcCommands
from station.vocabulary import LONGEST_LOT

AT_ONCE_S = 0.4
"""Longest time for which a command's answer waits for the command's end."""
_REMEMBERED = 8
_RECOVERIES: dict[ArmCause, RecoveryName] = {
    ArmCause.PROTECTIVE_STOP: "protective-stop",
    ArmCause.SAFETY_FAULT: "power",
    ArmCause.NOT_POWERED: "power",
    ArmCause.SAFEGUARD_STOP: "program",
    ArmCause.LOCAL_CONTROL: "program",
    ArmCause.PROGRAM_STOPPED: "program",
    ArmCause.REGISTERS_IN_USE: "program",
}
"""None for a pressed emergency stop: until it is released, nothing that a person orders here can work; then the arm is
without power."""
_COMMANDS = {
    OperatorCommandName.CHOOSE_RECIPE: CommandName.CHANGE_RECIPE,
    OperatorCommandName.START: CommandName.RESET,
    OperatorCommandName.CALL_OFF: CommandName.CALL_OFF,
    OperatorCommandName.SET_MODE: CommandName.SET_MODE,
}
"""Commands that the PLC has too are executed as the PLC's."""

log = logging.getLogger(__name__)


class OperatorCommands:
    """Executes operators' commands; those that the PLC has too are executed, and audited, by `plc_commands`."""

    def __init__(
        self,
        plc_commands: PlcCommands,
        service: Service,
        devices: DeviceManager,
        lots: LotManager,
        records: Records,
        audit: AuditLogger,
    ) -> None:
        self._plc_commands, self._service, self._devices, self._lots = plc_commands, service, devices, lots
        self._records, self._audit = records, audit
        self._lot_turn = asyncio.Lock()
        self._tickets = itertools.count(1)
        self._recent: deque[OperatorCommandView] = deque(maxlen=_REMEMBERED)
        self._tasks: dict[int, asyncio.Task[None]] = {}

    async def close(self) -> None:
        """Cancel the commands under way."""
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)

    @property
    def recent(self) -> tuple[OperatorCommandView, ...]:
        """Return the last commands, newest first."""
        return tuple(reversed(self._recent))

    @property
    def recoveries(self) -> tuple[RecoveryName, ...]:
        """Return the stops that a person may recover from after a check of the cell."""
        fault = self._devices.monitors[ARM].fault if ARM in self._devices.monitors else None
        found = _RECOVERIES.get(fault.cause) if isinstance(fault, ArmFault) else None
        return () if found is None else (found,)

    @property
    def possible(self) -> tuple[OperatorCommandName, ...]:
        """Return the commands that would be started now."""
        service, state = self._service, self._service.state
        conditions = {
            OperatorCommandName.CHOOSE_RECIPE: not self._plc_commands.recipe_changing,
            OperatorCommandName.START: not self._plc_commands.reset_refusal()
            and (state in WAITING or service.stopped_by_person),
            OperatorCommandName.STOP: not service.stopped_by_person
            and not service.ending
            and state is not State.LATCHED,
            OperatorCommandName.CALL_OFF: state in UNJUDGED,
            OperatorCommandName.RECOVER: bool(self.recoveries),
            OperatorCommandName.SET_MODE: True,
            OperatorCommandName.START_LOT: not self._lots.plc_names,
            OperatorCommandName.END_LOT: not self._lots.plc_names and bool(self._lots.named),
        }
        return tuple(order for order, possible in conditions.items() if possible)

    async def start(self, request: OperatorCommand) -> OperatorCommandView:
        """Start a command, and wait a moment for its end."""
        same = next((each for each in self.recent if _under_way(each, request)), None)
        stopped = self._service.stopped_by_person
        if request.order is (OperatorCommandName.START if stopped else OperatorCommandName.STOP):
            same = None  # the other one has overtaken it, or it is not in force yet: once more does no harm
        entry = same or OperatorCommandView(
            ticket=next(self._tickets),
            order=request.order,
            argument=request.argument,
            state="executing",
            why=None,
            who=request.person.who,
            began_utc_ms=utc_ms(),
            ended_utc_ms=None,
        )
        if same is None:
            self._recent.append(entry)
            task = asyncio.create_task(self._follow(entry, request), name=f"order {request.order}")
            self._tasks[entry.ticket] = task
            task.add_done_callback(lambda _: self._tasks.pop(entry.ticket, None))
        if (running := self._tasks.get(entry.ticket)) is not None:
            await asyncio.wait({running}, timeout=AT_ONCE_S)
        return next((each for each in self._recent if each.ticket == entry.ticket), entry)

    async def _follow(self, entry: OperatorCommandView, request: OperatorCommand) -> None:
        try:
            why = await self._execute(request)
        except StationError as error:
            why = message_of(error)
        except Exception as error:  # the pages must not show for ever that it is in progress
            log.exception("order %s", request.order)
            why = internal_fault(error)
        ended = entry.model_copy(
            update={"state": "done" if why is None else "failed", "why": why, "ended_utc_ms": utc_ms()}
        )
        self._recent = deque((ended if each.ticket == entry.ticket else each for each in self._recent), _REMEMBERED)

    async def _execute(self, request: OperatorCommand) -> Message | None:
        by, order, argument = (request.person.who, request.person.role), request.order, request.argument
        if order is OperatorCommandName.CALL_OFF and argument:
            if argument != str(self._service.registry.running_sequence):
                why = messages.ANOTHER_FRUIT(sequence=argument)
                self._audit.log_command(by, order, argument, why)
                return why
            argument = ""  # the command itself has none
        if order in _COMMANDS:
            if argument and not (argument.isascii() and argument.isdigit() and int(argument) <= 65_535):
                return messages.NO_NUMBER(command=order, argument=argument)
            command = Command(command=_COMMANDS[order], argument=int(argument or 0))
            why = None
            manual = command.command is CommandName.SET_MODE and command.argument == MANUAL
            if manual and (self._plc_commands.mode != MANUAL or self._service.manual_activity is None):
                # The person may reach into the cell next: no mode that the PLC sets may end that.
                why = await self._plc_commands.stop()
                self._audit.log_command(by, OperatorCommandName.STOP, "", why)
                if not self._service.stopped_by_person:
                    self._audit.log_command(by, order, argument, why := messages.STARTED_MEANWHILE())
                    return why
            return (await self._plc_commands.execute(command, by)).why or why
        match order:
            case OperatorCommandName.RECOVER:
                return await self._recover(argument, by)
            case OperatorCommandName.STOP:
                why = await self._plc_commands.stop()
            case OperatorCommandName.START_LOT:
                why = await self._start_lot(argument, request.grower, by)
            case _:
                why = await self._end_lot(argument, by)
        self._audit.log_command(by, order, argument, why)
        return why

    async def _recover(self, what: str, by: tuple[str, str]) -> Message | None:
        for standing in self.recoveries:
            if standing == what:
                return (await self._plc_commands.recover(Recover(what=standing), by)).why
        return messages.NOTHING_TO_RECOVER()

    async def _start_lot(self, name: str, grower: str, by: tuple[str, str]) -> Message | None:
        if self._lots.plc_names:
            return lots.PLC_NAMES()
        if not is_lot_name(name):
            return lots.BAD_NAME(name=name, longest=LONGEST_LOT)
        async with self._lot_turn:
            before = self._lots.named

            def register(connection: Connection) -> None:
                if before != name:
                    _end_registered(connection, before, by)
                known = grower or next((lot.grower for lot in read_lots(connection, 1, name=name)), "")
                if known:
                    start_lot(connection, name, known, by)

            try:
                await self._records.change_to_end(register)
            except RecordsError as error:
                return message_of(error)
            return None if await self._lots.set_lot(name) else lots.START_NOT_STORED(lot=name)

    async def _end_lot(self, name: str, by: tuple[str, str]) -> Message | None:
        if not self._lots.named:
            return lots.NONE()
        if name != self._lots.named:
            return lots.ANOTHER(lot=name, now=self._lots.named)
        async with self._lot_turn:
            if name != self._lots.named:  # another one was started meanwhile
                return None
            try:
                await self._records.change_to_end(lambda connection: _end_registered(connection, name, by))
            except RecordsError as error:
                return message_of(error)
            return None if await self._lots.set_lot("") else lots.END_NOT_STORED(lot=name)


def _end_registered(connection: Connection, name: str, by: tuple[str, str]) -> None:
    """End a lot in the records, unless it is not in them: one without a grower was never registered."""
    if read_lots(connection, 1, name=name):
        end_lot(connection, name, by)


def _under_way(entry: OperatorCommandView, request: OperatorCommand) -> bool:
    return entry.state == "executing" and (entry.order, entry.argument) == (request.order, request.argument)
