"""The twin's time, which a test's own clock can run ahead."""

import time
from typing import Protocol


class Clock(Protocol):
    """Source of monotonic time."""

    def now_s(self) -> float:
        """The time in seconds from an arbitrary start; it never goes back."""
        ...


class SteadyClock:
    """The machine's monotonic clock."""

    def now_s(self) -> float:
        """The machine's monotonic time in seconds."""
        return time.monotonic()
