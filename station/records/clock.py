"""Clock of the records."""

import time


def utc_ms() -> int:
    """Return the machine's clock, ms since 1970."""
    return time.time_ns() // 1_000_000
