"""Simulated clock: a heap of what happens when; time passes only from one to the next."""

import heapq
from collections.abc import Callable


class Timer:
    """Action at one moment, until it is cancelled."""

    __slots__ = ("_what",)

    def __init__(self, what: Callable[[], None]) -> None:
        self._what: Callable[[], None] | None = what

    def cancel(self) -> None:
        """Let it not happen. Idempotent."""
        self._what = None

    def happen(self) -> None:
        """Let it happen, unless it was cancelled."""
        if self._what is not None:
            self._what()


class Clock:
    """Both clocks of a machine: the monotonic one, and that of the day, which may jump."""

    def __init__(self) -> None:
        self.s = 0.0
        """Monotonic."""
        self.utc_offset_s = 1_700_000_000.0
        self._heap: list[tuple[float, int, Timer]] = []
        self._number = 0

    def time(self) -> float:
        """Return UTC, seconds since 1970, as the module `time` does."""
        return self.s + self.utc_offset_s

    def after(self, delay_s: float, what: Callable[[], None]) -> Timer:
        """Let something happen; of the same moment what was requested first comes first."""
        timer = Timer(what)
        self._number += 1
        heapq.heappush(self._heap, (self.s + delay_s, self._number, timer))
        return timer

    def run(self, until_s: float, ended: Callable[[], bool]) -> bool:
        """Let time pass until an end or a moment; whether it ended."""
        while self._heap and self._heap[0][0] <= until_s:
            self.s, _, timer = heapq.heappop(self._heap)
            timer.happen()
            if ended():
                return True
        return False
