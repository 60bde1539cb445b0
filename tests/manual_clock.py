"""A clock for the twin that moves only when a test moves it."""


class ManualClock:
    """Begins at 0 s."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        """The time that the test has reached, in seconds."""
        return self._now_s

    def advance(self, duration_s: float) -> None:
        """Move on."""
        assert duration_s >= 0, "a clock cannot go back"
        self._now_s += duration_s
