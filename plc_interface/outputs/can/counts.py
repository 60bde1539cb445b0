"""Arithmetic of encoder counts, which wrap round at 32 bits."""

from typing import NamedTuple

RANGE = 2**32


class Count(NamedTuple):
    """The encoder's last count."""

    value: int
    """0 to 2**32 - 1."""
    age_s: float


def further(count: int, by: int) -> int:
    """Add counts, which may be negative, to one of 0 to 2**32 - 1, modulo 2**32."""
    return (count + by) % RANGE


def ahead(of: int, count: int) -> int:
    """Return how far a count is ahead `of` the belt's, -2**31 to 2**31 - 1: at 3000 counts/s half takes eight days."""
    return (count - of + RANGE // 2) % RANGE - RANGE // 2
