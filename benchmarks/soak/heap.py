"""Memory in use: a process's own memory without what is free in its C library's heap, read from outside.

A process's memory also rises where the heap once had to reach further, since what is freed in between is taken again
piece by piece. What a leak makes rise is what is in use.
"""

import os
from struct import Struct

import psutil

_FIELD = Struct("<Q")
_FLAGS, _BEFORE_IN_USE = 7, 1
_LEAST_CHUNK = 32
_TRIES = 20
"""A walk beside a process that allocates may meet a chunk that is being divided or joined."""


def in_use_bytes(pid: int) -> int:
    """Return what a process uses of the memory that no other process shares, in bytes.

    Where its heap cannot be walked, all of the heap counts as used. So it is with one that has no room where it
    began, and goes on elsewhere.

    Raises:
        psutil.NoSuchProcess: it has ended.
        psutil.AccessDenied: its regions may not be listed.
    """
    process, own = psutil.Process(pid), 0
    for _ in range(_TRIES):
        regions = process.memory_maps(grouped=False)
        own = sum(region.private_clean + region.private_dirty for region in regions)
        heap = next((region for region in regions if region.path == "[heap]"), None)
        if heap is None:
            return own
        used = _used(pid, *(int(address, 16) for address in heap.addr.split("-")))
        if used is not None:
            return own - heap.private_clean - heap.private_dirty + used
    return own


def _used(pid: int, begins: int, ends: int) -> int | None:
    """Return the bytes in use on the heap between two addresses; None where the walk failed.

    The heap is a row of chunks: at byte 8 of each is its size, of which bit 0 is set if the chunk before is in use; the
    last, free, reaches to the heap's end (malloc_chunk in glibc's malloc/malloc.c). What waits in a thread's cache
    counts as used.
    """
    try:
        memory = os.open(f"/proc/{pid}/mem", os.O_RDONLY)
        try:
            heap = os.pread(memory, ends - begins, begins)
        finally:
            os.close(memory)
    except OSError:
        return None
    used = at = before = 0
    while at + _LEAST_CHUNK <= len(heap):
        field = _FIELD.unpack_from(heap, at + 8)[0]
        size = field & ~_FLAGS
        if size < _LEAST_CHUNK:
            break
        used += before * (field & _BEFORE_IN_USE)
        before, at = size, at + size
    return used if at == ends - begins else None
