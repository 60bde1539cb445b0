"""Arithmetic of encoder counts, which wrap round at 32 bits."""

from typing import NamedTuple

RANGE = 2**32


class Count(NamedTuple):
    """The encoder's last count."""

    value: int
    """0 to 2**32 - 1."""
    age_s: float


def further(count: int, by: int) -> int:
    """Add counts, modulo 2**32.

    Args:
        count: 0 to 2**32 - 1.
        by: counts, may be negative.
    """
    return (count + by) % RANGE


def ahead(of: int, count: int) -> int:
    """Return the distance between two counts, -2**31 to 2**31 - 1; at 3000 counts/s half the range takes eight days.

    Args:
        of: the belt's count.
        count: the target.
    """
    return (count - of + RANGE // 2) % RANGE - RANGE // 2
