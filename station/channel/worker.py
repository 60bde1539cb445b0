"""Worker thread for page requests: disk and pictures do not delay the cycle, and pages use at most one core."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from station.errors import StationError
from station.messages import jobs as messages

T = TypeVar("T")

LONGEST_S = 20.0
MOST_WAITING = 32


class PanelBusyError(StationError):
    """Too many requests at once, or one takes too long."""


class PanelWorker:
    """Runs one request after the other. Close it at the end."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "panel")
        self._waiting = 0

    async def do(self, work: Callable[[], T]) -> T:
        """Run a function, which may block for a moment, in the thread.

        Raises:
            PanelBusyError: it is not started, or its end is not waited for; a started one runs to its end.
            StationError: as the work raises it.
        """
        if self._waiting >= MOST_WAITING:
            raise PanelBusyError(messages.REQUESTS_FULL(number=self._waiting))
        self._waiting += 1
        future = self._thread.submit(work)
        future.add_done_callback(lambda _: self._done())
        try:
            async with asyncio.timeout(LONGEST_S):
                return await asyncio.wrap_future(future)
        except TimeoutError:
            raise PanelBusyError(messages.REQUEST_SLOW(limit_s=LONGEST_S)) from None

    def _done(self) -> None:
        self._waiting -= 1

    def close(self) -> None:
        """End the thread after the work under way. Blocks until then."""
        self._thread.shutdown(cancel_futures=True)
