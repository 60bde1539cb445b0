"""Housekeeping outside of inspections: recovers what an inspection needs where that is safe, and raises alarms."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping

from station.devices.gripper.errors import GripperFaultError, GripperNotActiveError
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import WAITING_FOR_DEVICES, Event
from station.inspection.states import State
from station.memory import return_freed_memory
from station.messages import operation as messages
from station.messages.message import Message, joined, message_of
from station.runtime.devices.manager import GRIPPER
from station.runtime.observability.observability import Observability
from station.runtime.production.production import Production
from station.settings.configuration import Configuration
from station.supervision import restarts

HOUSEKEEPING = "upkeep"
"""The task's name in /livez."""
PERIOD_S = 0.2
"""Pause between rounds, s: an estimate."""
_ALARMS_EVERY_S = 1.0
"""Time between checks of the alarms' conditions, s: an estimate."""
_RECIPES_EVERY_S = 2.0
"""Time between checks of the recipes' files, s: an estimate."""
_DAMAGE_EVERY_S = 10.0
"""Time between checks of the records' files, s: an estimate."""
_MEMORY_EVERY_S = 60.0
"""Images leave memory free between lasting objects, which is returned so often at most: an estimate, docs/soak.md."""
_LONGEST_RECOVERY_S = 300.0
"""A recovery that takes longer counts as stuck, as one of records on a disk that hangs, and the process is started
again. An estimate: the arm's program takes up to `arm.recovery_deadline_s`, a large database longer than any device."""
_CLOCK_STEP_S = 2.0
"""Least step of the wall clock against the monotonic clock between two checks that is an alarm, s: an estimate."""
_RECIPE_WITHIN_S = 10.0
"""The line's time to choose a recipe, before its absence is an alarm."""
_MANY_RESTARTS, _MANY_WITHIN_S = 3, 60.0
"""Restarts of one process that are an alarm, within a time, s: estimates."""
_MB = 1_000_000

_BETWEEN = {State.IDLE, State.RETREATING, State.RETREATING_READY, State.RETREATING_ACCEPTED}
"""No image is captured or measured. A line at full pace triggers during the retreat, and IDLE is rarely seen."""


class Housekeeping:
    """One task beside the cycle.

    Args:
        conditions: of alarms whose cause others watch; each returns the alarm's detail, None where it is not active.
        broken: error of the configuration at the start; None for none.
    """

    def __init__(
        self,
        configuration: Configuration,
        production: Production,
        observability: Observability,
        conditions: Mapping[AlarmId, Callable[[], Message | None]],
        broken: Message | None,
    ) -> None:
        self._service, self._devices, self._interlock = production.service, production.devices, production.interlock
        self._line_state, self._recipes = production.line_state, production.recipes
        self._metrics, self._liveness, self._audit = observability.metrics, observability.liveness, observability.audit
        self._conditions, self._broken = conditions, broken
        self._recipes_at_s = time.monotonic()
        self._reserve_mb = configuration.records.free_reserve_mb
        self._longest_pause_s = configuration.service.retry_longest_s
        self._logged_ready_s = 0.0
        self._recipe_wanted_s: float | None = None
        self._alarms_at_s = 0.0
        self._damage_at_s = 0.0
        self._memory_at_s = time.monotonic()
        self._clock_offset_s = time.time() - time.monotonic()
        self._pause_s, self._again_s = PERIOD_S, 0.0
        self._restarts_counted: dict[str, int] = {}
        self._recovery: asyncio.Task[None] | None = None
        self._recovery_began_s = 0.0

    async def run(self) -> None:
        """Run until cancelled."""
        try:
            await self._run()
        finally:
            if self._recovery is not None:
                self._recovery.cancel()
                await asyncio.gather(self._recovery, return_exceptions=True)

    async def _run(self) -> None:
        while True:
            if self._recovery is not None or self._service.state in WAITING_FOR_DEVICES:
                await self._recover()
            else:
                self._pause_s, self._again_s = PERIOD_S, 0.0
            if time.monotonic() - self._alarms_at_s > _ALARMS_EVERY_S:
                self._alarms_at_s = time.monotonic()
                self._update_alarms()
            if time.monotonic() - self._recipes_at_s > _RECIPES_EVERY_S:
                await self._refresh_recipes()
            if self._service.state in _BETWEEN and time.monotonic() - self._damage_at_s > _DAMAGE_EVERY_S:
                self._damage_at_s = time.monotonic()
                self._service.device_changed(await self._service.registry.find_damage())
            if self._service.state in _BETWEEN and time.monotonic() - self._memory_at_s > _MEMORY_EVERY_S:
                self._memory_at_s = time.monotonic()
                return_freed_memory()
            self._metrics.ready(ready=self._interlock.refusal()[0] is None)
            if self._recovery is None or time.monotonic() - self._recovery_began_s < _LONGEST_RECOVERY_S:
                self._liveness.progress(HOUSEKEEPING)
            await asyncio.sleep(PERIOD_S)

    async def _refresh_recipes(self) -> None:
        """Read what people changed in the recipes. The current lot does not change."""
        await asyncio.to_thread(self._recipes.refresh)
        self._recipes_at_s = time.monotonic()
        self._audit.log(*self._recipes.take_noticed())

    async def _recover(self) -> None:
        """Recover what is faulty, beside the rounds: without their progress the arm's program would be stopped."""
        service = self._service
        if self._recovery is None:
            self._recovery = asyncio.create_task(self._try_recovery(), name="recovery")
            self._recovery_began_s = time.monotonic()
        done, _ = await asyncio.wait({self._recovery}, timeout=PERIOD_S)
        if not done:
            return
        recovery, self._recovery = self._recovery, None
        recovery.result()
        entered_s = service.runner.entered_s
        if (
            service.registry.fault is None
            and self._logged_ready_s < entered_s
            and self._devices.healthy_since(entered_s)
        ):
            self._logged_ready_s = time.monotonic()
            service.runner.post(Event.READY)

    async def _try_recovery(self) -> None:
        """Try to recover what is faulty, with growing pauses; its monitor reports why a recovery failed."""
        activate = (
            self._service.makes_itself_ready
            and isinstance(self._devices.monitors[GRIPPER].fault, GripperNotActiveError | GripperFaultError)
            and set(self._devices.faults) == {GRIPPER}
        )
        play = self._devices.needs_program_restart and not self._liveness.stuck()
        if time.monotonic() < self._again_s or not (activate or play or self._service.registry.fault is not None):
            return
        self._pause_s = min(2 * self._pause_s, self._longest_pause_s)
        if self._service.registry.fault is not None:
            registry = self._service.registry
            await registry.reopen(reserve_bytes=self._reserve_mb * _MB)
            self._service.alarms.report_lost_records(registry.records.notices)
        with contextlib.suppress(StationError):
            if activate:
                # A stop, or another mode, may have come while the records were opened, and may come meanwhile.
                await self._devices.activate_if_safe(lambda: self._service.makes_itself_ready)
            elif play:
                await self._devices.restart_program()
        self._again_s = time.monotonic() + self._pause_s

    def _update_alarms(self) -> None:
        service, alarms = self._service, self._service.alarms
        alarms.tick()
        for monitor in self._devices.monitors.values():
            alarms.update_device(monitor)
        alarms.clear_absent(self._devices.monitors)
        fault = service.registry.fault
        alarms.update(AlarmId.RECORDS_NOT_WRITABLE, None if fault is None else message_of(fault))
        free_mb = service.registry.records.status().free_bytes / _MB
        alarms.update(
            AlarmId.DISK_LOW,
            messages.DISK_LOW(free_mb=free_mb, reserve_mb=self._reserve_mb) if free_mb < 2 * self._reserve_mb else None,
        )
        alarms.update(AlarmId.CONFIGURATION_BROKEN, self._broken)
        problems = self._recipes.problems
        alarms.update(AlarmId.RECIPE_BROKEN, joined(problems) if problems else None)
        alarms.update(AlarmId.NO_RECIPE, messages.NEVER_CHOSEN() if self._recipe_missing() else None)
        alarms.update(AlarmId.CALIBRATION_OLD, self._devices.calibration.alarm_detail())
        for alarm, detail in self._conditions.items():
            alarms.update(alarm, detail())
        self._line_state.update_alarms()
        self._count_restarts()
        self._check_clock()

    def _recipe_missing(self) -> bool:
        """Return whether the line has wanted inspections for a while and no recipe is active.

        At a normal start the recipe comes only after the line is enabled and the devices are found healthy.
        """
        report, now_s = self._line_state.last_report, time.monotonic()
        wanted = report is not None and report.enabled and self._service.state is State.IDLE
        if self._service.active is not None or not wanted:
            self._recipe_wanted_s = None
            return False
        self._recipe_wanted_s = now_s if self._recipe_wanted_s is None else self._recipe_wanted_s
        return now_s - self._recipe_wanted_s > _RECIPE_WITHIN_S

    def _count_restarts(self) -> None:
        many: list[Message] = []
        for name, program in restarts.read().items():
            for _ in range(program.total - self._restarts_counted.get(name, 0)):
                self._metrics.restarted(name)
            self._restarts_counted[name] = program.total
            lately = program.within(_MANY_WITHIN_S)
            if program.given_up:
                many.append(messages.PROCESS_GIVEN_UP(process=name))
            elif lately >= _MANY_RESTARTS:
                many.append(messages.PROCESS_RESTARTED(process=name, times=lately, within_s=_MANY_WITHIN_S))
        self._service.alarms.update(AlarmId.PROCESS_RESTARTS, joined(many) if many else None)

    def _check_clock(self) -> None:
        alarms = self._service.alarms
        offset_s = time.time() - time.monotonic()
        if abs(offset_s - self._clock_offset_s) > _CLOCK_STEP_S:
            step_s = offset_s - self._clock_offset_s
            step = messages.CLOCK_FORWARD if step_s > 0 else messages.CLOCK_BACK
            alarms.raise_(AlarmId.CLOCK_STEPPED, step(step_s=abs(step_s)))
        else:
            alarms.clear(AlarmId.CLOCK_STEPPED)
        self._clock_offset_s = offset_s
