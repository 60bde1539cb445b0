"""Clock of the records."""

import time
from datetime import UTC, datetime


def utc_ms() -> int:
    """Return the machine's clock, ms since 1970."""
    return time.time_ns() // 1_000_000


def formatted(utc_ms: int) -> str:
    """Return a time for a terminal.

    Args:
        utc_ms: ms since 1970.
    """
    return datetime.fromtimestamp(utc_ms / 1000, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
