"""Worker thread of the records' reader: each address or person has one request in it, and the others' take turns."""

from collections.abc import Callable
from contextvars import ContextVar
from typing import TypeVar

from station.channel.worker import PanelWorker

T = TypeVar("T")

HOLDER: ContextVar[str] = ContextVar("HOLDER", default="")
"""The person, or the address, that the present request is for."""


class PastWorker:
    """Runs the reader's work. Close it at the end."""

    def __init__(self) -> None:
        self._worker = PanelWorker()

    async def do(self, work: Callable[[], T]) -> T:
        """Run a function for the present request's holder; see `PanelWorker.do`."""
        return await self._worker.do(work, HOLDER.get())

    def close(self) -> None:
        """End the thread after the work under way. Blocks until then."""
        self._worker.close()
