"""Histogram of the live image's grey levels."""

import math
from collections.abc import Sequence


def histogram(counts: Sequence[int], wide: float = 256.0, high: float = 80.0) -> str:
    """Return the polygon of an image's pixels per bin; heights are square roots, so that small bins are visible."""
    largest = math.sqrt(max(counts, default=0)) or 1.0
    gap = wide / max(1, len(counts) - 1)
    tops = (f"{number * gap:.1f},{high - high * math.sqrt(count) / largest:.1f}" for number, count in enumerate(counts))
    return " ".join([f"0,{high:g}", *tops, f"{wide:g},{high:g}"])
