"""Clock of what is stored and shown: the machine's, in UTC."""

import time
from datetime import UTC, datetime


def utc_ms() -> int:
    """Return the machine's clock, ms since 1970-01-01 UTC; never for waits."""
    return time.time_ns() // 1_000_000


def formatted(utc_ms: int) -> str:
    """Return a time, ms since 1970, for a terminal."""
    return datetime.fromtimestamp(utc_ms / 1000, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
