"""PLC commands: carried out between fruits, also where an operator gives them at the panel."""

import asyncio
import contextlib
import logging
import time
from typing import Any

from station.channel.line import Command, CommandDone, CommandName
from station.channel.panel import Recover
from station.channel.server import is_expired
from station.devices.arm.faults import ArmFault
from station.devices.camera.interface import CameraError
from station.errors import BadInputError
from station.inspection.cycle import UNJUDGED, WAITING, Event
from station.inspection.states import STATES, State
from station.messages import commands as messages
from station.messages import operation, readiness
from station.messages.maintenance import UNDER_WAY
from station.messages.message import Message, message_of
from station.runtime.cycle.service import Service
from station.runtime.devices.manager import DeviceManager
from station.runtime.observability.audit_logger import (
    PANEL,
    PLC,
    AlarmChange,
    AuditLogger,
    alarm_entry,
    command_entry,
)
from station.runtime.production.lots import LotManager
from station.runtime.recipes.active import ActiveRecipes
from station.state_files import StateFiles
from station.vocabulary import Refusal

log = logging.getLogger(__name__)

DEADLINE_S = 25.0
"""With the wait for the command before. Less than the PLC interface's own deadline for a command."""
STOP_WITHIN_S = 0.5
"""Longest wait for a stop to be stored before it is carried out, s: an estimate."""
PRODUCTION, MAINTENANCE, MANUAL = 1, 2, 3
"""PackML's unit modes; in manual mode a person moves things by hand."""
MODES = (PRODUCTION, MAINTENANCE, MANUAL)
_STOPPED, _MODE = "stopped_by_a_person", "mode"
_AT_ONCE = {CommandName.CALL_OFF, CommandName.CLEAR_ALARMS}
"""Wait for no other command: a change of recipe lasts until the very fruit that is to be called off has left."""
_JUDGED = {State.RECORDING_ACCEPT, State.RECORDING_REJECT}
_ON_ALARMS: dict[CommandName, AlarmChange] = {CommandName.CLEAR_ALARMS: "acknowledged", CommandName.RESET: "reset"}


class PlcCommands:
    """Executes the PLC's commands, most of them one after the other; the state files store stop and mode."""

    def __init__(
        self,
        service: Service,
        devices: DeviceManager,
        recipes: ActiveRecipes,
        lots: LotManager,
        state_files: StateFiles,
        audit: AuditLogger,
    ) -> None:
        self._service, self._devices, self._recipes = service, devices, recipes
        self._lots, self._state_files, self._audit = lots, state_files, audit
        self.mode = PRODUCTION
        self.recipe_changing = False
        self._turn = asyncio.Lock()
        self._stop_wanted = False
        """By the last order of a person, also before its file has it."""
        self._stop_file, self._mode_file = asyncio.Lock(), asyncio.Lock()
        self._storing_mode: asyncio.Task[bool] | None = None
        self._storing_reset: asyncio.Task[bool] | None = None

    def restore(self) -> None:
        """Restore after a restart a person's stop, which lasts until a reset, and the mode.

        A file that cannot be read, or has an unknown value, counts as a stop or as manual mode: a person may reach into
        the cell.
        """
        files = self._state_files
        if not (files.is_missing(_STOPPED) or files.read(_STOPPED) == b"no"):
            self._stop_wanted = True
            self._service.stop()
        if not files.is_missing(_MODE):
            stored = files.read(_MODE)
            self.mode = next((mode for mode in MODES if stored == b"%d" % mode), MANUAL)
            self._service.set_mode(production=self.mode == PRODUCTION)

    async def _store_stop(self) -> bool:
        """Make it durable whether a person's stop is wanted; the last order's is what the file has at the end."""
        async with self._stop_file:
            wanted = b"yes" if self._stop_wanted else b"no"
            return await asyncio.to_thread(self._state_files.write, _STOPPED, wanted)

    async def execute(self, command: Command, by: tuple[str, str] = (PLC, PLC)) -> CommandDone:
        """Execute one command by the name and role of who gave it."""
        log.info("%s (%s) orders %s %s", *by, command.command, command.argument)
        before, alarms = self._value_before(command.command), self._service.alarms.alarms
        try:
            # With its wait for the command before: the PLC reads timed_out soon after, and nothing may begin then.
            async with asyncio.timeout(DEADLINE_S):
                async with contextlib.nullcontext() if command.command in _AT_ONCE else self._turn:
                    # The PLC's own limit may be shorter; a command of the panel outlives the request that ordered it.
                    if by[1] == PLC and is_expired():
                        raise TimeoutError  # noqa: TRY301 (it ends as one that is too slow itself)
                    why = await self._execute(command, by)
        except TimeoutError:
            why = messages.TOO_SLOW(command=command.command, limit_s=DEADLINE_S, activity=self._activity())
        if why is not None:
            log.warning("%s was not done: %s", command.command, why)
        done = CommandDone(done=why is None, why=why)
        self._audit.log(command_entry(command, done, before, by))
        if command.command in _ON_ALARMS:
            now, change = self._service.alarms.alarms, _ON_ALARMS[command.command]
            changed = [alarm for alarm, was in alarms.known.items() if now.get(alarm) != was]
            self._audit.log(*(alarm_entry(*by, change, alarm) for alarm in changed))
        return done

    def _value_before(self, command: CommandName) -> dict[str, Any]:
        """Return the value that a command is about to change, for the audit log."""
        active = self._service.active
        match command:
            case CommandName.CHANGE_RECIPE:
                snapshot = None if active is None else active.snapshot
                return {"recipe": None if snapshot is None else [snapshot.number, snapshot.name, snapshot.revision]}
            case CommandName.SET_MODE:
                return {"mode": self.mode}
            case _:
                return {"state": str(self._service.state)}

    async def _execute(self, command: Command, by: tuple[str, str]) -> Message | None:
        match command.command:
            case CommandName.CHANGE_RECIPE:
                return await self._change_recipe(command.argument)
            case CommandName.RESET:
                return await self._reset(by)
            case CommandName.CALL_OFF:
                return await self._call_off()
            case CommandName.SET_MODE:
                return await self._set_mode(command.argument)
            case CommandName.CLEAR_ALARMS:
                self._service.alarms.acknowledge_returned()
                return None

    async def _set_mode(self, mode: int) -> Message | None:
        if mode not in MODES:
            return messages.MODE_UNKNOWN(mode=mode)
        activity = self._service.manual_activity
        if activity is not None and mode != self.mode:
            return messages.MODE_KEPT(activity=activity)
        if mode != MANUAL:
            try:
                while self._devices.light_by_hand:  # also one that is set meanwhile
                    await self._devices.restore_light()
            except CameraError as error:
                return message_of(error)
            if (activity := self._service.manual_activity) is not None and mode != self.mode:  # begun meanwhile
                return messages.MODE_KEPT(activity=activity)
        self.mode = mode
        self._service.set_mode(production=mode == PRODUCTION)
        # A write that outlasts its order is not left behind, or it could replace the next order's.
        self._storing_mode = asyncio.create_task(self._store_mode())
        if self._service.manual_activity is None:  # its motion is its own, where the present mode is set again
            if not self._service.makes_itself_ready:
                await self._devices.end_recovery()
            if mode != PRODUCTION:
                await self._end_homing()
        return None if await asyncio.shield(self._storing_mode) else messages.MODE_NOT_STORED(mode=mode)

    async def _end_homing(self) -> None:
        """Stop jaws and arm where the station makes itself ready; what follows a fruit comes to its end."""
        runner = self._service.runner
        await runner.taken()  # a reset by the station itself may be on its way
        if runner.state in {State.RESETTING, State.HOMING}:
            runner.post(Event.STOP)
            await runner.taken()  # with its HALT

    async def _store_mode(self) -> bool:
        """Make the mode durable; the last order's is what the file has at the end."""
        async with self._mode_file:
            return await asyncio.to_thread(self._state_files.write, _MODE, b"%d" % self.mode)

    async def _change_recipe(self, number: int) -> Message | None:
        await asyncio.to_thread(self._recipes.read)
        found = self._recipes.find(number)
        if found is None:
            return self._recipe_unknown(number)
        widest_mm = self._devices.cell.gripper.max_width_mm
        if found.recipe.expected_width.smallest_mm >= widest_mm:
            return messages.RECIPE_TOO_WIDE(number=number, widest_mm=widest_mm)
        try:
            self._service.pacing.check(found.recipe)
        except BadInputError as error:
            return message_of(error)
        self.recipe_changing = True
        try:
            await self._service.runner.until(lambda state: STATES[state].refusal is not Refusal.BUSY)
            kept = await self._lots.choose(found)
            log.info("recipe %s (%d) is active", found.recipe.name, found.recipe.plc_number)
        finally:
            self.recipe_changing = False
        return None if kept else messages.RECIPE_NOT_STORED(number=number)

    def _recipe_unknown(self, number: int) -> Message:
        known = ", ".join(map(str, self._recipes.numbers))
        refusal = messages.RECIPE_UNKNOWN(number=number, known=known) if known else messages.NO_RECIPES(number=number)
        problems = self._recipes.problems
        return messages.RECIPE_UNKNOWN_BECAUSE(refusal=refusal, problems=problems) if problems else refusal

    async def stop(self) -> Message | None:
        """Accept no trigger until the next reset, also over a restart; the fruit under way is inspected to its end.

        Returns:
            Why the stop is not complete; None if it is.
        """
        service, self._stop_wanted = self._service, True
        storing = asyncio.create_task(self._store_stop())
        await asyncio.wait({storing}, timeout=STOP_WITHIN_S)  # durable before it is shown, but no disk delays a stop
        if not self._stop_wanted:
            return messages.STARTED_MEANWHILE()
        service.stop()
        await service.end_manual()  # before a HALT, which would stop the jaws that open then
        if service.stopped_by_person and service.state in {State.IDLE, State.RESETTING, State.HOMING, State.CHECKING}:
            service.runner.post(Event.STOP, operation.STOPPED_AT_PANEL())
        await self._devices.end_recovery()
        reached = await service.runner.until(lambda state: state in WAITING or not service.stopped_by_person)
        if reached not in WAITING:
            return messages.STARTED_MEANWHILE()
        return None if await storing else messages.STOP_NOT_STORED()

    async def recover(self, request: Recover, by: tuple[str, str] = (PANEL, PANEL)) -> CommandDone:
        """Recover the arm after a stop that a person has checked; the station continues after a reset."""
        if STATES[self._service.state].refusal is Refusal.BUSY or self._service.state is State.RETREATING_READY:
            return CommandDone(done=False, why=messages.BUSY())
        log.info("a person at the cell asks for: %s", request.what)
        try:
            await self._devices.recover(request.what)
            why = None
        except ArmFault as fault:
            why = message_of(fault)
        self._audit.log_command(by, "recover", request.what, why)
        return CommandDone(done=why is None, why=why)

    async def _call_off(self) -> Message | None:
        service = self._service
        if service.state not in UNJUDGED:
            busy = STATES[service.state].refusal is Refusal.BUSY
            return messages.JUDGED() if busy else None
        service.runner.post(Event.CALLED_OFF, operation.CALLED_OFF())
        reached = await service.runner.until(lambda state: state not in UNJUDGED)
        return messages.JUDGED() if reached in _JUDGED else None  # its judgement may have come first

    def reset_refusal(self) -> Message | None:
        """Return why a reset would do nothing now; None if it would work."""
        if self._service.ending:
            return messages.ENDING()
        if stop := self._devices.active_stop or self._devices.power_missing:
            return messages.CONFIRM_STOP(stop=message_of(stop))
        if activity := self._service.manual_activity:
            return UNDER_WAY(activity=activity)
        busy = STATES[self._service.state].refusal is Refusal.BUSY
        return messages.BUSY_CALL_OFF() if busy else None

    async def _reset(self, by: tuple[str, str]) -> Message | None:
        service = self._service
        await service.runner.taken()  # a stop may be on its way, which this reset comes after
        kept = self._stop_wanted and by == (PLC, PLC)  # a hand may be at the gel, and a program resets by itself
        if why_not := self.reset_refusal() or (readiness.STOPPED_BY_PERSON() if kept else None):
            return why_not
        self._stop_wanted = False
        ordered_s, program_stopped = time.monotonic(), self._devices.program_stopped
        service.allow()
        # As of a mode: a write that outlasts the reset's deadline could replace that of a stop that comes next.
        self._storing_reset = asyncio.create_task(self._store_stop())
        await asyncio.shield(self._storing_reset)
        await service.runner.taken()
        # The disk may take seconds, and a person's stop in them is the later order, also before its own write ends.
        if self._stop_wanted or service.stopped_by_person:
            return messages.STOPPED_MEANWHILE()
        if why_not := self._later_stop(ordered_s, program_stopped=program_stopped):
            return why_not
        state = service.state
        inspects = STATES[state].refusal is Refusal.BUSY and state is not State.RECORDING_LATCHED
        if state in {State.IDLE, State.RETREATING_READY} or inspects:  # it is ready, or has been since the order
            service.alarms.reset()
            return None
        return self.reset_refusal() or await self._make_ready(ordered_s, program_stopped=program_stopped)

    async def _make_ready(self, ordered_s: float, *, program_stopped: bool) -> Message | None:
        """Make the station ready from the state that it is in by now; the arguments are those of `_later_stop`.

        A reset that fails stays in force in production mode alone: in another one, people may reach into the cell when
        the device that it waited for returns.
        """
        self._service.request_reset()
        self._devices.confirm_clear()
        ready = False
        try:
            why_not = await self._lead_to_ready(ordered_s, program_stopped=program_stopped)
            ready = why_not is None
        finally:
            if not ready and self.mode != PRODUCTION:
                self._service.withdraw_reset()
                self._devices.withdraw_confirmation()
                if self._service.manual_activity is None:
                    await self._devices.end_recovery()
                    await self._end_homing()
        return why_not

    async def _lead_to_ready(self, ordered_s: float, *, program_stopped: bool) -> Message | None:
        service, state = self._service, self._service.state
        if state not in {State.LATCHED, State.STOPPED}:
            try:
                await self._devices.restart_program()
            except ArmFault as fault:
                return message_of(fault)
            if why_not := self._later_stop(ordered_s, program_stopped=program_stopped):
                return why_not
        if activity := service.manual_activity:  # begun while this reset waited
            return UNDER_WAY(activity=activity)
        if state is State.STOPPED:
            service.runner.post(Event.RESET)
        elif STATES[state].needs_person:
            service.runner.post(Event.PERSON_CONFIRMED, operation.RESET())
        return await self._until_ready()

    def _later_stop(self, ordered_s: float, *, program_stopped: bool) -> Message | None:
        """Return what has required a person since a reset was ordered, and is not confirmed by it; None for nothing.

        Args:
            ordered_s: monotonic time of the reset.
            program_stopped: a person had stopped the arm's program on the pendant by then.
        """
        runner = self._service.runner
        latched = STATES[runner.state].needs_person and max(runner.entered_s, runner.stopped_s) > ordered_s
        stopped = self._devices.program_stopped and not program_stopped
        return self._activity() if latched or stopped else None

    async def _until_ready(self) -> Message | None:
        """Wait for what a reset has started; return why the station is not ready."""
        service, tried_s = self._service, time.monotonic()
        reached = await service.runner.until(
            lambda now: (
                service.stopped_by_person
                or now is State.IDLE
                or (now is State.LATCHED and service.runner.entered_s > tried_s)
            )
        )
        if service.stopped_by_person:
            return messages.STOPPED_MEANWHILE()
        return None if reached is State.IDLE else self._activity()

    def _activity(self) -> Message:
        faults = list(self._devices.faults.values())
        return message_of(faults[0]) if faults else STATES[self._service.state].activity
