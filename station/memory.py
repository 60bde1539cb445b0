"""Freed memory of a process: retained for its next images, or returned to the system."""

import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
_KEPT_BYTES = 64 * 2**20
_LARGEST_BYTES = 8 * 2**20
"""An image of the sensor has 0.9 MB, and 3.7 MB in float32."""


def keep_freed_memory() -> None:
    """Configure the C library to retain freed memory, up to 64 MB at its end, in one heap for all threads.

    Otherwise every image's memory is mapped anew, page by page, and drawing a frame takes three times as long. With a
    heap for each thread every thread's largest image stays there: 12 MB more in a station, 95 MB in its twin (two
    stations side by side, docs/soak.md). Call it before other threads begin. Numbers: mallopt(3), M_TRIM_THRESHOLD,
    M_MMAP_THRESHOLD and M_ARENA_MAX. A C library without them is left as it is.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)
        mallopt(_MMAP_THRESHOLD, _LARGEST_BYTES)
        mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)


def return_freed_memory() -> None:
    """Return what is free in the heap to the system, also between what is in use.

    Meanwhile, for milliseconds, no other thread gets memory. A C library without malloc_trim(3) retains what is free.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
