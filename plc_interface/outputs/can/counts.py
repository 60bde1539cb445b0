"""Arithmetic of encoder counts, which wrap round at 32 bits."""

RANGE = 2**32


def further(count: int, by: int) -> int:
    """Add counts, which may be negative, to one of 0 to 2**32 - 1, modulo 2**32."""
    return (count + by) % RANGE


def ahead(of: int, count: int) -> int:
    """Return how far a count is ahead `of` the belt's, -2**31 to 2**31 - 1: at 3000 counts/s half takes eight days."""
    return (count - of + RANGE // 2) % RANGE - RANGE // 2
