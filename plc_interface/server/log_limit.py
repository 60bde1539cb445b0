"""Rate-limited log: a flood of requests cannot fill it."""

import logging
from collections import Counter, defaultdict

from station.allowance import Allowance

BURST = 20
"""Lines of one kind at once."""
REFILL_S = 5.0
"""One more line of a kind after this time."""
SUMMARY_S = 10.0
"""Period of the summary of omitted lines."""


class LimitedLog:
    """Writes lines of each kind up to an allowance that refills, and reports the number of omitted lines."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._allowances: defaultdict[str, Allowance] = defaultdict(lambda: Allowance(BURST, REFILL_S))
        self._left_out: Counter[str] = Counter()
        self._summed_up_s = float("-inf")

    def write(self, kind: str, now_s: float, level: int, message: str, *arguments: object) -> None:
        """Write a line, or count it as omitted. `kind` is a plural noun, for the summary."""
        if self._allowances[kind].take(now_s):
            self._log.log(level, message, *arguments)
        else:
            self._left_out[kind] += 1

    def sum_up(self, now_s: float, *, last: bool = False) -> None:
        """Log the number of omitted lines, if any, when it is due again or, for the last time, at once."""
        if self._left_out and (last or now_s - self._summed_up_s >= SUMMARY_S):
            counts = ", ".join(f"{count} of {kind}" for kind, count in sorted(self._left_out.items()))
            self._log.warning("lines left out: %s", counts)
            self._left_out.clear()
            self._summed_up_s = now_s
