"""Metrics and health over HTTP, in the station's own event loop: /metrics, /livez, /readyz, /version."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from station.errors import StationError
from station.service.metrics import Metrics


class AddressError(StationError):
    """The address cannot be served on."""


@dataclass(frozen=True, slots=True)
class Dependency:
    """One thing that inspecting needs."""

    name: str
    state: Literal["ok", "degraded", "fault", "unknown"]
    """`degraded` still inspects."""
    age_s: float | None
    """Since it was last heard; None where never."""
    detail: str = ""
    remedy: str = ""
    """Empty only where ok."""


@dataclass(frozen=True, slots=True)
class Readiness:
    """Whether a trigger would be accepted, and why not."""

    ready: bool
    why: str
    """One sentence with the remedy; empty where ready."""
    dependencies: tuple[Dependency, ...]


class Liveness:
    """Fed by progress alone: what stands still for longer than it may makes the station not live."""

    def watch(self, name: str, within_s: float) -> None:
        """Expect progress of this name, from now on, at least every so many seconds."""
        raise NotImplementedError

    def unwatch(self, name: str) -> None:
        """Expect it no more."""
        raise NotImplementedError

    def progress(self, name: str) -> None:
        """Something was got done; a name that is not watched is ignored."""
        raise NotImplementedError

    def stuck(self) -> dict[str, float]:
        """What makes no progress, with its age in s; empty while alive."""
        raise NotImplementedError


class HealthServer:
    """Serves until it is closed; leaves no thread, task or port."""

    def __init__(
        self,
        host: str,
        port: int,
        metrics: Metrics,
        liveness: Liveness,
        readiness: Callable[[], Readiness],
        version: Mapping[str, str],
    ) -> None:
        raise NotImplementedError

    async def start(self) -> int:
        """Listen; returns the port.

        Raises:
            AddressError: the port is in use, or the address is not this machine's.
        """
        raise NotImplementedError

    async def close(self) -> None:
        """Answer what is under way, for at most a second, and stop. Idempotent."""
        raise NotImplementedError
