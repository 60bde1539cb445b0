"""Memory in use: a process's own memory without what is free in its C library's heap, read from outside.

A process's memory also rises where the heap once had to reach further, since what is freed in between is taken again
piece by piece. What a leak makes rise is what is in use.
"""

import os
import re
from struct import Struct

_FIELD = Struct("<Q")
_FLAGS, _BEFORE_IN_USE = 7, 1
_LEAST_CHUNK = 32
_TRIES = 20
"""A walk beside a process that allocates may meet a chunk that is being divided or joined."""
_KB = 1024


def in_use_bytes(pid: int) -> int:
    """Return what a process uses of the memory that no other process shares, in bytes.

    Where its heap cannot be walked, all of the heap counts as used.

    Raises:
        ProcessLookupError: it has ended.
    """
    own, heap = 0, 0
    try:
        with open(f"/proc/{pid}/smaps", encoding="utf-8") as regions:  # noqa: PTH123 (a kernel's file)
            in_heap = False
            for line in regions:
                if re.match(r"[0-9a-f]+-[0-9a-f]+ ", line):
                    in_heap = line.rstrip().endswith("[heap]")
                elif line.startswith("Private_"):
                    size = _KB * int(line.split()[1])
                    own, heap = own + size, heap + size * in_heap
        used = next((found for _ in range(_TRIES) if (found := _walked(pid)) is not None), heap)
    except FileNotFoundError as error:
        raise ProcessLookupError from error
    return own - heap + used


def _walked(pid: int) -> int | None:
    """Return the bytes in use on the heap; None where the walk failed.

    The heap is a row of chunks: at byte 8 of each is its size, of which bit 0 says that the chunk before is in use; the
    last, free, reaches to the heap's end (malloc_chunk in glibc's malloc/malloc.c). What waits in a thread's cache
    counts as used.
    """
    with open(f"/proc/{pid}/maps", encoding="utf-8") as regions:  # noqa: PTH123 (a kernel's file)
        place = next((line.split(maxsplit=1)[0] for line in regions if line.rstrip().endswith("[heap]")), None)
    if place is None:
        return 0
    begins, ends = (int(address, 16) for address in place.split("-"))
    try:
        memory = os.open(f"/proc/{pid}/mem", os.O_RDONLY)
    except PermissionError:
        return None
    try:
        heap = os.pread(memory, ends - begins, begins)
    finally:
        os.close(memory)
    used = at = before = 0
    while at + _LEAST_CHUNK <= len(heap):
        field = _FIELD.unpack_from(heap, at + 8)[0]
        size = field & ~_FLAGS
        if size < _LEAST_CHUNK:
            break
        used += before * (field & _BEFORE_IN_USE)
        before, at = size, at + size
    return used if at == len(heap) else None
