"""Encoder counts, which go through 32 bits and begin again at 0."""

from typing import NamedTuple

RANGE = 2**32


class Count(NamedTuple):
    """What the encoder said last."""

    value: int
    """0 to 2**32 - 1."""
    age_s: float


def further(count: int, by: int) -> int:
    """The count that lies so many counts further on.

    Args:
        count: 0 to 2**32 - 1.
        by: counts, also negative.
    """
    return (count + by) % RANGE


def ahead(of: int, count: int) -> int:
    """How far a count lies ahead of another, -2**31 to 2**31 - 1; at 3000 counts/s half the range takes eight days.

    Args:
        of: where the belt is.
        count: where it shall be.
    """
    return (count - of + RANGE // 2) % RANGE - RANGE // 2
