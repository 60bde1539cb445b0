"""Metrics and health over HTTP, in the station's own event loop: /metrics, /livez, /readyz, /version."""

import asyncio
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from station.channel.panel_maintenance import PartHealth
from station.messages.message import Message
from station.runtime.observability.metrics import Metrics
from station.serving.guard import GuardedListener, Limits
from station.serving.server import AddressError, Server, listen

START_S = 5.0
LIMITS = Limits(most=64, per_address=32, reserve=32)
"""Known is this machine alone."""


@dataclass(frozen=True, slots=True)
class Readiness:
    """Readiness for a trigger, with the reason if not ready."""

    ready: bool
    why: Message | None
    """With the remedy; None if ready."""
    dependencies: tuple[PartHealth, ...]


class Liveness:
    """Watchdog: a name without progress for longer than allowed makes the station not live."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin without any name to watch; the clock is monotonic, in s."""
        self._clock = clock
        self._within_s: dict[str, float] = {}
        self._last_s: dict[str, float] = {}

    def watch(self, name: str, within_s: float) -> None:
        """Monitor a name: from now on it has to make progress at least every `within_s` seconds."""
        self._within_s[name] = within_s
        self._last_s[name] = self._clock()

    def progress(self, name: str) -> None:
        """Note progress; a name that is not monitored is ignored."""
        if name in self._last_s:
            self._last_s[name] = self._clock()

    def ages_s(self) -> dict[str, float]:
        """Return the time since each name's last progress."""
        now_s = self._clock()
        return {name: now_s - last_s for name, last_s in self._last_s.items()}

    def stuck(self) -> dict[str, float]:
        """Return the names without progress, with their age in s; empty while alive."""
        return {name: age_s for name, age_s in self.ages_s().items() if age_s > self._within_s[name]}


class HealthServer:
    """HTTP server of metrics and health; after `close` no thread, task or port is left."""

    def __init__(
        self,
        host: str,
        port: int,
        metrics: Metrics,
        liveness: Liveness,
        readiness: Callable[[], Readiness],
        version: Mapping[str, str],
    ) -> None:
        """Set what is served; the port is not open yet, and 0 takes a free one. `readiness` must not block."""
        self._host = host
        self._port = port
        self._metrics = metrics
        self._liveness = liveness
        self._readiness = readiness
        self._version = dict(version)
        self._listener: GuardedListener | None = None
        self._server: Server | None = None
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> int:
        """Listen; returns the port.

        Raises:
            AddressError: the port is in use, or the address is not this machine's.
        """
        listener = listen(self._host, self._port, "metrics", "metrics and health", LIMITS)
        routes = [
            Route("/metrics", self._metrics_page),
            Route("/livez", self._livez),
            Route("/readyz", self._readyz),
            Route("/version", self._version_page),
        ]
        self._server = Server(listener, Starlette(routes=routes), lifespan="off")
        self._task = asyncio.create_task(self._server.run_until_exit(), name="health")
        self._listener = listener
        async with asyncio.timeout(START_S):
            while not self._server.started:
                if self._task.done():
                    self._task.result()
                    raise AddressError(f"the health server on {self._host}:{self._port} ended at once; see the log")
                await asyncio.sleep(0.005)
        return listener.getsockname()[1]

    @property
    def flooded_by(self) -> str:
        """The address that floods this server with connections; empty for none."""
        return "" if self._listener is None else self._listener.flooded_by

    async def close(self) -> None:
        """Answer what is under way, for at most a second, and stop. Idempotent."""
        if self._server is None or self._task is None:
            return
        self._server.should_exit = True
        try:
            await self._task
        finally:
            self._server = self._task = None

    async def _metrics_page(self, request: Request) -> Response:
        content, kind = self._metrics.exposition(request.headers.get("accept", ""))
        return Response(content, headers={"content-type": kind})

    async def _livez(self, _request: Request) -> Response:
        stuck = self._liveness.stuck()
        body = {
            "live": not stuck,
            "stuck_s": {name: round(age_s, 3) for name, age_s in stuck.items()},
            "progress_age_s": {name: round(age_s, 3) for name, age_s in self._liveness.ages_s().items()},
        }
        return JSONResponse(body, status_code=503 if stuck else 200)

    async def _readyz(self, _request: Request) -> Response:
        readiness = self._readiness()
        return JSONResponse(_readiness_json(readiness), status_code=200 if readiness.ready else 503)

    async def _version_page(self, _request: Request) -> Response:
        return JSONResponse(self._version)


def _readiness_json(readiness: Readiness) -> dict[str, Any]:
    """Return the body of /readyz: each message as its English sentence, and beside it as id and parameters."""
    dependencies = [
        {"name": each.name, "state": each.state, "age_s": each.age_s}
        | _message_json("detail", each.detail)
        | _message_json("remedy", each.remedy)
        for each in readiness.dependencies
    ]
    return {"ready": readiness.ready} | _message_json("why", readiness.why) | {"dependencies": dependencies}


def _message_json(name: str, message: Message | None) -> dict[str, Any]:
    said = None if message is None else message.model_dump(mode="json")
    return {name: str(message or ""), f"{name}_message": said}
