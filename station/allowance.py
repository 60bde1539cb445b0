"""Allowance of events: a burst at once, then one more after each refill time."""


class Allowance:
    """Number of events that are still permitted: a burst at once, and one more after each `refill_s`."""

    def __init__(self, burst: int, refill_s: float) -> None:
        self._burst, self._refill_s = burst, refill_s
        self._left, self._at_s = float(burst), float("-inf")

    def take(self, now_s: float) -> bool:
        """Take one event at this monotonic time; false if none is left."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) / self._refill_s)
        self._at_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True
