"""Worker thread for page requests: disk and pictures do not delay the cycle, and pages use at most one core."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from station.errors import StationError
from station.messages import jobs as messages

T = TypeVar("T")

LONGEST_S = 20.0
MOST_WAITING = 32
"""Of one holder."""


class PanelBusyError(StationError):
    """Too many requests at once, or one takes too long."""


@dataclass(slots=True)
class _Holder:
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)
    waiting: int = 0


class PanelWorker:
    """Runs one request after the other, of each holder one in turn. Close it at the end."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "panel")
        self._holders: dict[str, _Holder] = {}

    async def do(self, work: Callable[[], T], holder: str = "") -> T:
        """Run a function, which may block for a moment, in the thread.

        Args:
            holder: whom it is for: another's request is not behind all of this one's.

        Raises:
            PanelBusyError: it is not started, or its end is not waited for; a started one runs to its end.
            StationError: as the work raises it.
        """
        own = self._holders.setdefault(holder, _Holder())
        if own.waiting >= MOST_WAITING:
            raise PanelBusyError(messages.REQUESTS_FULL(number=own.waiting))
        own.waiting += 1
        try:
            async with asyncio.timeout(LONGEST_S), own.turn:
                return await asyncio.wrap_future(self._thread.submit(work))
        except TimeoutError:
            raise PanelBusyError(messages.REQUEST_SLOW(limit_s=LONGEST_S)) from None
        finally:
            own.waiting -= 1
            if not own.waiting:
                del self._holders[holder]

    def close(self) -> None:
        """End the thread after the work under way. Blocks until then."""
        self._thread.shutdown(cancel_futures=True)
