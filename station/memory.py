"""Freed memory of a process: retained for its next images, or returned to the system."""

import ctypes
import gc

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_KEPT_BYTES = 64 * 2**20
_LARGEST_BYTES = 8 * 2**20
"""An image of the sensor has 0.9 MB, and 3.7 MB in float32."""


def keep_freed_memory() -> None:
    """Configure the C library to retain freed memory, up to 64 MB at its end.

    Otherwise every image's memory is mapped anew, page by page, and drawing a frame takes three times as long. Numbers:
    mallopt(3), M_TRIM_THRESHOLD and M_MMAP_THRESHOLD. A C library without them is left as it is.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _LARGEST_BYTES)
        mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)


def return_freed_memory() -> None:
    """Collect unreachable objects, and return what is free to the system.

    It takes milliseconds where the collector's objects were frozen after the start (`gc.freeze`). A C library without
    malloc_trim(3) retains what is free.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
