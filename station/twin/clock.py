"""The twin's time, which tests can run ahead."""

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


class ManualClock:
    """A clock that moves only when a test moves it."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        """The time that the test has reached, in seconds."""
        return self._now_s

    def advance(self, duration_s: float) -> None:
        """Move on.

        Args:
            duration_s: seconds, not negative.

        Raises:
            ValueError: the duration is negative.
        """
        if duration_s < 0:
            raise ValueError(f"a clock cannot go back by {-duration_s} s")
        self._now_s += duration_s
