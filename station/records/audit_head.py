"""Head of the audit trail, stored outside the database: without it, a cut-off end would not be found.

Two lines of fixed length, written in turn in place, as the sequence mark's. It is saved after the commit of new rows,
so it may be some rows behind, never ahead.
"""

import logging
import os
import zlib
from pathlib import Path
from typing import NamedTuple

from station.atomic_file import sync_folder

FILE_NAME = "audit_head"
log = logging.getLogger(__name__)

_LINE_BYTES = 10 + 1 + 64 + 1 + 8 + 1


class Head(NamedTuple):
    """Number and hash of the last row."""

    seq: int
    hash: str


def read_head(folder: Path) -> Head | None:
    """Read the last saved head; None if the file is missing or has no valid line.

    Raises:
        OSError: the file exists and cannot be read.
    """
    return max((head for head in _lines(folder / FILE_NAME) if head is not None), default=None)


def save_head(folder: Path, head: Head) -> None:
    """Make the head durable; it replaces the older of the two lines.

    Args:
        head: of a durable row.

    Raises:
        OSError: it may not be durable.
    """
    path = folder / FILE_NAME
    first, second = _lines(path)
    body = b"%010d %s" % (head.seq, head.hash.encode("ascii"))
    line = body + b" %08x\n" % zlib.crc32(body)
    fresh = first is None and second is None
    replaced = 1 if first is not None and (second is None or second < first) else 0
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        os.pwrite(descriptor, line * 2 if fresh else line, 0 if fresh else replaced * _LINE_BYTES)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    if fresh:
        sync_folder(folder)


def try_save_head(folder: Path, head: Head) -> None:
    """Save the head; a failure is logged only, because the trail itself is durable without it.

    Args:
        head: of a durable row.
    """
    try:
        save_head(folder, head)
    except OSError as error:
        log.warning("the audit trail's head could not be kept outside the database: %s", error)


def _lines(path: Path) -> tuple[Head | None, Head | None]:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None, None
    return _parsed(content[:_LINE_BYTES]), _parsed(content[_LINE_BYTES : 2 * _LINE_BYTES])


def _parsed(line: bytes) -> Head | None:
    body, _, checksum = line.rstrip(b"\n").rpartition(b" ")
    number, _, digest = body.partition(b" ")
    if len(line) != _LINE_BYTES or not number.isdigit() or checksum != b"%08x" % zlib.crc32(body):
        return None
    return Head(int(number), digest.decode("ascii", "replace"))
