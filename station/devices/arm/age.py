"""Age of a state that has the timestamp of another machine's clock."""

from collections import deque

WINDOW_S = 30.0
"""Long against any network's pauses, short against the drift of two clocks: 50 ppm make 1.5 ms of it."""


class TimestampAge:
    """The age of a stream's latest timestamp.

    The two clocks differ in zero and slightly in rate. The least recent difference between them is taken as that of a
    state without delay; a state's age is the excess of its difference over it. A frozen stream ages with our own clock,
    and a delayed one shows its delay.
    """

    def __init__(self) -> None:
        self._lows: deque[tuple[float, float]] = deque()

    def age_s(self, timestamp_s: float, now_s: float) -> float:
        """Return the age of a state by its timestamp, on the sender's clock, and by our own, which never goes back."""
        difference = now_s - timestamp_s
        while self._lows and self._lows[-1][1] >= difference:
            self._lows.pop()
        self._lows.append((now_s, difference))
        while now_s - self._lows[0][0] > WINDOW_S:
            self._lows.popleft()
        return difference - self._lows[0][1]
