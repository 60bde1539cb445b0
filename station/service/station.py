"""The station's process: everything put together, begun and ended in order."""

import asyncio
import contextlib
import logging
import uuid
from collections.abc import Callable, Coroutine
from importlib.metadata import version
from pathlib import Path

from station.errors import StationError
from station.inspection.states import STATES
from station.records.errors import RecordsError
from station.records.records import Records
from station.service.alarm_desk import AlarmDesk
from station.service.crew import Crew
from station.service.eye import Eye
from station.service.health import HealthServer, Liveness
from station.service.inspector import Inspector
from station.service.keeping import Kept
from station.service.line_server import LineServer
from station.service.metrics import Metrics
from station.service.orders import Orders
from station.service.readiness import Gate
from station.service.recipe_book import RecipeBook
from station.service.reference import Golden
from station.service.service import CYCLE, Service
from station.service.upkeep import UPKEEP, Upkeep
from station.settings.configuration import Configuration
from station.settings.plc import line_endpoint

log = logging.getLogger(__name__)

PROGRAM = "fruit-station"
_USUAL_DEADLINE_S = 30.0


class Station:
    """One start of the station.

    Args:
        configuration: the site's, or its last good form.
        broken: what was wrong with the configuration's files; empty for nothing.
    """

    def __init__(self, configuration: Configuration, broken: str = "") -> None:
        self.boot = uuid.uuid4().hex
        self._configuration, self._broken = configuration, broken
        self._stop = asyncio.Event()

    def stop(self) -> None:
        """Ask for an orderly end; asking again changes nothing."""
        self._stop.set()

    async def run(self, on_started: Callable[[int], None]) -> None:
        """Run until `stop` is called; by then the running inspection has its outcome and the jaws are open.

        Args:
            on_started: told the port of metrics and health once all is served. Devices may still be away.

        Raises:
            StationError: the station cannot even begin: an address is in use.
        """
        configuration, settings = self._configuration, self._configuration.service
        versions = {PROGRAM: version(PROGRAM)}
        liveness = Liveness()
        metrics = Metrics(versions[PROGRAM], settings.inspection_deadline_s or _USUAL_DEADLINE_S)
        kept = Kept(configuration.home)
        book = RecipeBook(configuration.recipes_folder, kept)
        await asyncio.to_thread(book.read)
        alarms = AlarmDesk(metrics)
        async with contextlib.AsyncExitStack() as stack:
            eye = Eye(Golden(kept), settings.reference)
            stack.callback(eye.close)
            records = Records(configuration.home / "records", configuration.records, self.boot)
            stack.push_async_callback(records.close)
            service: Service | None = None

            def device_changed(name: str, fault: StationError | None) -> None:
                alarms.device(name, crew.watches[name].told_fault)
                if service is not None:
                    service.device_changed(fault)

            def progress(name: str) -> None:
                liveness.progress(name)
                if crew.watches[name].fault is None:
                    metrics.heard(name)

            crew = Crew(configuration, device_changed, progress)
            service = Service(
                configuration,
                records,
                crew,
                Inspector(crew, eye, settings),
                alarms,
                metrics,
                liveness,
                versions,
            )
            try:
                await records.reopen()
                await alarms.recall(records)
            except RecordsError as error:
                service.records_fault = error
            metrics.watch_records(records.status)
            service.active = book.last_active()
            orders = Orders(service, crew, book, metrics)
            gate = Gate(self.boot, service, crew, orders, book, liveness)
            upkeep = Upkeep(
                service,
                crew,
                gate,
                orders,
                book,
                metrics,
                liveness,
                broken=self._broken,
                reserve_mb=configuration.records.free_reserve_mb,
                longest_pause_s=settings.retry_longest_s,
            )
            endpoint = line_endpoint(configuration.handshake, configuration.home)
            if endpoint.startswith("ipc://"):
                Path(endpoint.removeprefix("ipc://")).parent.mkdir(parents=True, exist_ok=True)
            line = LineServer(endpoint, service, orders, gate)
            line_task = self._begin(stack, line.serve(), "line server")
            health = HealthServer(
                configuration.metrics.host, configuration.metrics.port, metrics, liveness, gate.readiness, versions
            )
            port = await health.start()
            stack.push_async_callback(health.close)
            stack.push_async_callback(crew.close)
            await crew.open()
            for name in crew.watches:
                liveness.watch(name, settings.progress_s)
            cycle_task = self._begin(stack, service.conductor.run(), CYCLE)
            upkeep_task = self._begin(stack, upkeep.run(), UPKEEP)
            self._begin(stack, alarms.keep(records), "alarms' records")
            for name in (CYCLE, UPKEEP):
                liveness.watch(name, settings.progress_s)
            on_started(port)
            await self._until_asked((line_task, cycle_task, upkeep_task))
            await self._end(service)

    async def _until_asked(self, needed: tuple[asyncio.Task[None], ...]) -> None:
        """Wait for the order to end; a task that nothing works without and that ended by a bug ends the process."""
        asked = asyncio.create_task(self._stop.wait(), name="order to end")
        try:
            done, _ = await asyncio.wait({asked, *needed}, return_when=asyncio.FIRST_COMPLETED)
            for task in done - {asked}:
                task.result()
                raise StationError(f"{task.get_name()} has ended by itself; start the station again")
        finally:
            asked.cancel()
            await asyncio.gather(asked, return_exceptions=True)

    async def _end(self, service: Service) -> None:
        service.stop_asked = True
        limit_s = self._configuration.service.clean_up_deadline_s
        try:
            async with asyncio.timeout(limit_s):
                await service.conductor.until(lambda state: STATES[state].may_exit)
        except TimeoutError:
            log.warning("ended after %g s in the middle of: %s", limit_s, STATES[service.state].sentence)

    @staticmethod
    def _begin(stack: contextlib.AsyncExitStack, work: Coroutine[None, None, None], name: str) -> asyncio.Task[None]:
        task = asyncio.create_task(work, name=name)

        async def end() -> None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        stack.push_async_callback(end)
        return task
