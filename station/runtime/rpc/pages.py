"""Page handlers for Recipes, History and Maintenance, put together for the panel's server."""

import contextlib
from typing import Self

from station.channel.server import Handlers
from station.channel.worker import PanelWorker
from station.records.records import Records
from station.runtime.observability.observability import Observability
from station.runtime.production.production import Production
from station.runtime.rpc.calibration import PanelCalibration
from station.runtime.rpc.history import PanelHistory
from station.runtime.rpc.log import LogRing
from station.runtime.rpc.maintenance import PanelMaintenance
from station.runtime.rpc.recipes import PanelRecipes
from station.settings.configuration import Configuration


class PanelPages:
    """Handlers of these pages; use them inside `async with`, and close before the devices."""

    def __init__(
        self,
        configuration: Configuration,
        records: Records,
        production: Production,
        observability: Observability,
    ) -> None:
        self._worker, self._log = PanelWorker(), LogRing()
        history = PanelHistory(records)
        recipes = PanelRecipes(configuration.home, configuration.recipes_folder, self._worker)
        maintenance = PanelMaintenance(production, observability, configuration.home, self._worker, self._log)
        self._ball = PanelCalibration(
            configuration, production, records, observability.audit, self._worker, maintenance
        )
        self.handlers: Handlers = {
            **history.handlers,
            **recipes.handlers,
            **maintenance.handlers,
            **self._ball.handlers,
        }
        """Handler of each request."""
        self._open = contextlib.AsyncExitStack()

    async def __aenter__(self) -> Self:
        """Store log lines from now on."""
        self._open.callback(self._worker.close)
        self._open.enter_context(self._log)
        self._open.push_async_callback(self._ball.close)
        return self

    async def __aexit__(self, *_: object) -> None:
        """Cancel what runs."""
        await self._open.aclose()
