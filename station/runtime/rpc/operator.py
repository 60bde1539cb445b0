"""Panel server: answers the HMI's process from memory; nothing here waits for a device."""

import asyncio
import logging
import time
from functools import partial

from station.channel.line import Noted
from station.channel.panel_run import (
    DeviceView,
    Fruit,
    GetFruit,
    GetPanelState,
    GetPicture,
    GetRecent,
    GetRecipes,
    OperatorCommand,
    PanelState,
    PersonNoted,
    Picture,
    Recent,
    RecipeNames,
    Recipes,
    RecipeSummary,
)
from station.channel.server import Handlers
from station.clock import utc_ms
from station.inspection.states import STATES
from station.messages import operation as messages
from station.messages.message import Message, message_of
from station.records.audit import AuditEntry
from station.records.errors import RecordsError
from station.records.records import Records
from station.runtime.alarms.commands import AlarmCommands
from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.production.operator_commands import OperatorCommands
from station.runtime.production.production import Production
from station.runtime.recipes.active import ActiveRecipe
from station.runtime.rpc.recent_inspections import RecentInspections
from station.runtime.rpc.restored_inspections import read_counts, read_recent
from station.runtime.rpc.setup import setup_view
from station.settings.configuration import Configuration
from station.vocabulary import Refusal

log = logging.getLogger(__name__)

SILENT_S = 3.0
"""Time for a killed HMI process to restart, on a machine that is otherwise idle."""


class PanelServer:
    """Channel server for the HMI."""

    def __init__(
        self,
        configuration: Configuration,
        production: Production,
        records: Records,
        alarms: AlarmCommands,
        audit: AuditLogger,
    ) -> None:
        self._configuration = configuration
        self._interlock, self._service, self._devices = production.interlock, production.service, production.devices
        self._lots, self._recipes, self._line_state = production.lots, production.recipes, production.line_state
        self._records, self._alarms, self._audit = records, alarms, audit
        self._operator_commands = OperatorCommands(
            production.plc_commands, self._service, self._devices, self._lots, records, audit
        )
        self._inspections = RecentInspections(partial(read_counts, records.folder))
        self._heard_s: float | None = None
        self.flooded_by = ""
        """The address that floods the pages, as their process last reported it; empty for none."""
        self._service.registry.listen(self._inspections.add)
        self._service.listen(self._inspections.set_outcome)
        self.handlers: Handlers = {
            GetPanelState: self._state,
            GetRecent: self._recent,
            GetFruit: self._fruit,
            GetPicture: self._picture,
            GetRecipes: self._list_recipes,
            OperatorCommand: self._operator_commands.start,
            PersonNoted: self._person,
            **alarms.handlers,
        }
        """For a channel's server."""

    async def restore(self) -> None:
        """Restore the last fruit of the previous start, and the counts of their lots."""
        pacing = self._service.pacing
        try:
            found = await asyncio.to_thread(
                read_recent, self._records.folder, lambda recipe: pacing.limits(recipe).inspection_s
            )
        except RecordsError as error:
            log.warning("the last fruit are not shown: %s", error)
            return
        self._inspections.restore(*found)

    async def close(self) -> None:
        """Cancel the commands under way, and what is still being read."""
        await self._operator_commands.close()
        await self._inspections.close()

    def hmi_fault(self) -> Message | None:
        """Return the fault of the HMI's process; None for none, and before its first message."""
        age_s = 0.0 if self._heard_s is None else time.monotonic() - self._heard_s
        return messages.PAGES_SILENT(age_s=age_s) if age_s > SILENT_S else None

    async def _state(self, request: GetPanelState) -> PanelState:
        self._heard_s = time.monotonic()
        if request.flooded_by is not None:
            self.flooded_by = request.flooded_by
        service, line = self._service, self._interlock.state()
        facts, active = STATES[service.state], service.active
        report = self._line_state.last_report
        return PanelState(
            boot=line.boot,
            utc_ms=utc_ms(),
            state=service.state,
            activity=facts.activity,
            packml_state=line.packml_state,
            mode=line.mode,
            ready=line.ready,
            why_not_ready=line.why_not_ready,
            busy=facts.refusal is Refusal.BUSY,
            needs_person=facts.needs_person,
            stopping=service.stopped_by_person,
            simulated=line.simulated,
            recipe=None if active is None else _recipe_name(active),
            lot=self._lots.lot,
            named_lot=self._lots.named,
            plc_names_lots=self._lots.plc_names,
            plc_connected=report is not None and report.plc_connected,
            plc_alive=report is not None and report.plc_alive,
            line_trouble=self._line_state.fault(),
            check_due=self._devices.calibration.refusal(),
            alarms=self._alarms.listed(),
            devices=tuple(
                DeviceView(name=name, fault=message_of(monitor.fault) if monitor.fault else None, age_s=monitor.age_s)
                for name, monitor in self._devices.monitors.items()
            ),
            orders=self._operator_commands.recent,
            may=self._operator_commands.possible,
            recoveries=self._operator_commands.recoveries,
            running_sequence=service.registry.running_sequence,
            last_sequence=self._inspections.last_sequence,
            fruit_changes=self._inspections.changes,
            lot_counts=self._inspections.counts(self._lots.lot or self._lots.named),
            deadline_s=None if active is None else service.pacing.limits(active.recipe).inspection_s,
            setup=setup_view(self._configuration, self._devices),
        )

    async def _recent(self, request: GetRecent) -> Recent:
        return Recent(fruit=self._inspections.recent(request.most))

    async def _fruit(self, request: GetFruit) -> Fruit:
        return self._inspections.fruit(request.sequence)

    async def _picture(self, request: GetPicture) -> Picture:
        return await self._inspections.picture(request.sequence)

    async def _list_recipes(self, _request: GetRecipes) -> Recipes:
        found = [active for number in self._recipes.numbers if (active := self._recipes.find(number)) is not None]
        active = self._service.active
        return Recipes(
            recipes=tuple(_recipe_view(each) for each in found),
            active=None if active is None else _recipe_view(active),
            problems=self._recipes.problems,
        )

    async def _person(self, request: PersonNoted) -> Noted:
        person, action = request.person, f"panel.{request.what}"
        old, new = request.old or None, request.new or None
        entry = AuditEntry(person.who, person.role, action, request.subject, old=old, new=new)
        self._audit.log(entry)
        return Noted()


def _recipe_name(active: ActiveRecipe) -> RecipeNames:
    recipe = active.recipe
    return RecipeNames(
        number=recipe.plc_number, name=recipe.name, title=recipe.title, revision=active.snapshot.revision
    )


def _recipe_view(active: ActiveRecipe) -> RecipeSummary:
    return RecipeSummary(**_recipe_name(active).model_dump(), values=active.snapshot.text)
