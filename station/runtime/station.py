"""Station process: makes all parts, starts them, and ends them in order."""

import asyncio
import contextlib
import logging
import uuid
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path

from station.channel.server import ChannelServer
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.inspection.states import STATES
from station.messages import operation as messages
from station.messages.message import Message, verbatim
from station.messages.supervision import TASK_ENDED
from station.outbox.lag import OutboxMonitor
from station.outbox.status import outbox_folder, read_status
from station.records.last_backup import last_backup_utc_s
from station.records.records import Records
from station.runtime.alarms.commands import AlarmCommands
from station.runtime.alarms.manager import AlarmManager
from station.runtime.cycle.actions import Inspector
from station.runtime.cycle.service import CYCLE, Service
from station.runtime.devices.calibration import ActiveCalibration
from station.runtime.devices.manager import DeviceManager
from station.runtime.imaging.golden_reference import GoldenReference
from station.runtime.imaging.worker import VisionWorker
from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.observability.health import HealthServer, Liveness
from station.runtime.observability.metrics import Metrics
from station.runtime.observability.observability import Observability
from station.runtime.observability.startup_audit import end_entry, start_entries
from station.runtime.production.housekeeping import HOUSEKEEPING, Housekeeping
from station.runtime.production.line_state import LineState
from station.runtime.production.lots import LotManager
from station.runtime.production.plc_commands import PlcCommands
from station.runtime.production.production import Production
from station.runtime.production.readiness import Interlock
from station.runtime.recipes.active import ActiveRecipes
from station.runtime.rpc.operator import PanelServer
from station.runtime.rpc.pages import PanelPages
from station.runtime.rpc.plc import PlcInterfaceServer
from station.settings.configuration import Configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.state_files import StateFiles
from station.supervision.notify import extended_start, feed_watchdog, notify

log = logging.getLogger(__name__)

PROGRAM = "fruit-station"
_USUAL_DEADLINE_S = 30.0


class Station:
    """One run of the station process.

    Args:
        configuration: the site's, or its last valid version.
        broken: the error in its present files; empty for none.
    """

    def __init__(self, configuration: Configuration, broken: str = "") -> None:
        self.boot = uuid.uuid4().hex
        self._configuration, self._broken = configuration, broken
        self._stop = asyncio.Event()
        self.service: Service | None = None
        """The cycle, once `run` has put it together."""
        self.recipes: ActiveRecipes | None = None
        """The recipes in force, likewise."""

    def stop(self) -> None:
        """Request an orderly end; a second call changes nothing."""
        self._stop.set()

    async def run(self, on_started: Callable[[int], None]) -> None:
        """Run until `stop` is called; then the running inspection gets its outcome and the jaws open before it returns.

        Args:
            on_started: gets the port of metrics and health once everything is served. Devices may still be away.

        Raises:
            StationError: the station cannot start: an address is in use.
        """
        async with contextlib.AsyncExitStack() as stack:
            tasks, port = await self._build(stack)
            on_started(port)
            notify("READY=1")
            await self._until_stop(tasks)
            await self._end()

    async def _build(self, stack: contextlib.AsyncExitStack) -> tuple[tuple[asyncio.Task[None], ...], int]:
        configuration, settings = self._configuration, self._configuration.service
        versions = {PROGRAM: version(PROGRAM)}
        liveness, metrics = Liveness(), Metrics(versions[PROGRAM], settings.inspection_deadline_s or _USUAL_DEADLINE_S)
        state_files, alarms = StateFiles(configuration.home), AlarmManager(metrics, to_restore=True)
        records = Records(configuration.home / "records", configuration.records, self.boot)
        # Closed in reverse order: the records last, right after the last audit entry.
        stack.push_async_callback(records.close)
        audit = AuditLogger(records)
        stack.push_async_callback(self._note_end, audit)

        def device_changed(name: str, fault: StationError | None) -> None:
            alarms.update_device(devices.monitors[name])
            service.device_changed(fault)

        def progress(name: str) -> None:
            liveness.progress(name)
            if devices.monitors[name].fault is None:
                metrics.heard(name)

        devices = DeviceManager(configuration, device_changed, progress)
        _register_scrapes(metrics, configuration, records, devices.calibration)
        metrics.expect((*devices.monitors, "plc_interface", "plc"))
        vision = VisionWorker(GoldenReference(state_files, devices.calibration.golden), settings.reference)
        stack.callback(vision.close)
        observability = Observability(self.boot, versions, metrics, liveness, audit)
        inspector = Inspector(devices, vision, configuration, alarms, metrics)
        self.service = service = Service(configuration, records, devices, inspector, alarms, observability)
        # The first start of a release may migrate the records of years, which takes longer than any other start.
        async with extended_start():
            await service.registry.reopen(lambda: alarms.restore(records))
        self.recipes = recipes = ActiveRecipes(configuration.recipes_folder, state_files)
        await asyncio.to_thread(recipes.read)
        lots = LotManager(service, recipes, audit, state_files)
        await asyncio.to_thread(lots.restore)
        self._note_start(audit, state_files, versions)
        plc_commands = PlcCommands(service, devices, recipes, lots, state_files, audit)
        line_state = LineState(alarms, metrics)
        plc_commands.restore()
        interlock = Interlock(service, devices, lots, plc_commands, line_state, observability)
        production = Production(service, devices, recipes, lots, plc_commands, line_state, interlock)
        alarm_commands = AlarmCommands(alarms, audit)
        panel = PanelServer(configuration, production, records, alarm_commands, audit)
        health = HealthServer(
            configuration.metrics.host, configuration.metrics.port, metrics, liveness, interlock.readiness, versions
        )
        housekeeping = Housekeeping(
            configuration,
            production,
            observability,
            {
                AlarmId.HMI_LOST: panel.hmi_fault,
                AlarmId.OUTBOX_BEHIND: OutboxMonitor(configuration.outbox, configuration.home).alarm_detail,
                AlarmId.CONNECTION_FLOOD: lambda: _flood(panel, health),
            },
            verbatim(self._broken) if self._broken else None,
        )
        await panel.restore()  # before the PLC interface publishes another outcome of one of these fruit
        tasks = [self._serve_plc_interface(stack, PlcInterfaceServer(production, alarm_commands))]
        pages = PanelPages(configuration, records, production, observability)
        self._serve(stack, panel, pages)
        port = await health.start()
        stack.push_async_callback(health.close)
        await self._open_devices(stack, devices, pages, alarms)
        tasks += [self._begin(stack, service.runner.run(), CYCLE), self._begin(stack, housekeeping.run(), HOUSEKEEPING)]
        self._begin(stack, alarms.store_changes(records), "alarms' records")
        self._begin(stack, audit.run(), "audit trail")
        self._watch_progress(stack, liveness, (*devices.monitors, CYCLE, HOUSEKEEPING))
        return tuple(tasks), port

    @staticmethod
    async def _open_devices(
        stack: contextlib.AsyncExitStack, devices: DeviceManager, pages: PanelPages, alarms: AlarmManager
    ) -> None:
        """Open the devices; manual motions from the panel end before the devices are closed."""
        alarms.clear_absent(devices.monitors)
        stack.push_async_callback(devices.close)
        await stack.enter_async_context(pages)
        await devices.open()

    def _serve_plc_interface(self, stack: contextlib.AsyncExitStack, server: PlcInterfaceServer) -> asyncio.Task[None]:
        endpoint = _with_folder(line_endpoint(self._configuration.handshake, self._configuration.home))
        return self._begin(stack, ChannelServer(endpoint, server.handlers).serve(), "line server")

    def _serve(self, stack: contextlib.AsyncExitStack, panel: PanelServer, pages: PanelPages) -> None:
        stack.push_async_callback(panel.close)
        endpoint = _with_folder(panel_endpoint(self._configuration.hmi, self._configuration.home))
        self._begin(stack, ChannelServer(endpoint, {**panel.handlers, **pages.handlers}).serve(), "panel server")

    def _watch_progress(self, stack: contextlib.AsyncExitStack, liveness: Liveness, names: tuple[str, ...]) -> None:
        for name in names:
            liveness.watch(name, self._configuration.service.progress_s)
        self._begin(stack, feed_watchdog(lambda: liveness.stuck().keys().isdisjoint({CYCLE, HOUSEKEEPING})), "watchdog")

    def _note_start(self, audit: AuditLogger, state_files: StateFiles, versions: Mapping[str, str]) -> None:
        entries, confirm = start_entries(self.boot, self._configuration, state_files, versions, self._broken)
        audit.log(*entries, on_stored=partial(asyncio.to_thread, confirm))

    async def _note_end(self, audit: AuditLogger) -> None:
        """Write the last audit entry of this start, if it can be written in time."""
        audit.log(end_entry(self.boot, requested=self._stop.is_set()))
        await audit.flush()

    async def _until_stop(self, needed: tuple[asyncio.Task[None], ...]) -> None:
        """Wait for the request to end; a required task that ends by a bug ends the process."""
        asked = asyncio.create_task(self._stop.wait(), name="order to end")
        try:
            done, _ = await asyncio.wait({asked, *needed}, return_when=asyncio.FIRST_COMPLETED)
            for task in done - {asked}:
                task.result()
                raise StationError(TASK_ENDED(task=task.get_name()))
        finally:
            asked.cancel()
            await asyncio.gather(asked, return_exceptions=True)

    async def _end(self) -> None:
        """End the running inspection with its outcome, open the jaws and move the arm home."""
        service = self.service
        if service is None:
            return
        service.end()
        limit_s = self._configuration.service.clean_up_deadline_s
        # Its arm leaves only while the cycle renews its lease.
        by_hand = asyncio.create_task(service.end_manual(), name="end of what is moved by hand")
        try:
            async with asyncio.timeout(limit_s):
                await asyncio.wait({by_hand})  # which can be left, where what it ends takes no cancellation
                await by_hand
                await service.runner.until(lambda state: STATES[state].may_exit)
        except TimeoutError:
            log.warning("ended after %g s in the middle of: %s", limit_s, STATES[service.state].activity)

    @staticmethod
    def _begin(stack: contextlib.AsyncExitStack, work: Coroutine[None, None, None], name: str) -> asyncio.Task[None]:
        task = asyncio.create_task(work, name=name)

        async def end() -> None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        stack.push_async_callback(end)
        return task


def _flood(panel: PanelServer, health: HealthServer) -> Message | None:
    if panel.flooded_by:
        return messages.PAGES_FLOODED(address=panel.flooded_by)
    return messages.METRICS_FLOODED(address=health.flooded_by) if health.flooded_by else None


def _with_folder(endpoint: str) -> str:
    """Return the endpoint, and make the folder of a socket file; only this user may access it."""
    if endpoint.startswith("ipc://"):
        Path(endpoint.removeprefix("ipc://")).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    return endpoint


def _register_scrapes(
    metrics: Metrics, configuration: Configuration, records: Records, calibrated: ActiveCalibration
) -> None:
    metrics.watch_calibration(lambda: calibrated.figures)
    metrics.watch_records(records.status)
    metrics.watch_backup(partial(last_backup_utc_s, configuration.home))
    if configuration.outbox.postgresql.enabled or configuration.outbox.mqtt.enabled:
        metrics.watch_outbox(partial(read_status, outbox_folder(configuration.home)))
