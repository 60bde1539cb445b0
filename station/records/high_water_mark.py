"""High-water mark of sequence numbers, stored outside the database so that it outlives it.

Two lines of fixed length, each a number with its CRC-32, written in turn in place: a torn write spoils at most the
line that was being written, and a full disk stops nothing.
"""

import os
import zlib
from pathlib import Path

from station.atomic_file import sync_folder
from station.messages import records as messages
from station.records.errors import SequenceError

LARGEST = 2**32 - 1
MARK_NAME = "sequence"
_LINE_BYTES = 20


class HighWaterMark:
    """Mark file of one folder. Not safe for use by two threads."""

    def __init__(self, path: Path) -> None:
        """Read the file, which the first `save` makes.

        Raises:
            OSError: it exists and cannot be read.
        """
        self.path = path
        self.value = 0
        """The highest number given."""
        self._older = 0
        self.known = False
        """Whether the file was there and a line of it is whole."""
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return
        lines = [_parsed(content[start : start + _LINE_BYTES]) for start in (0, _LINE_BYTES)]
        whole = [value for value in lines if value is not None]
        if whole:
            self.value, self.known = max(whole), True
            self._older = lines.index(min(whole)) if len(whole) == 2 else lines.index(None)

    def next(self) -> int:
        """Take the next number; `save` before it is used anywhere.

        Raises:
            SequenceError: all numbers were given.
        """
        if self.value >= LARGEST:
            raise SequenceError(messages.NUMBERS_USED_UP(largest=LARGEST), messages.ARCHIVE())
        self.value += 1
        return self.value

    def save(self) -> None:
        """Make the value durable.

        Raises:
            OSError: it may not be durable.
        """
        line = f"{self.value:010d} {zlib.crc32(b'%010d' % self.value):08x}\n".encode()
        fresh = not self.path.exists()
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            os.pwrite(descriptor, line if self.known else line * 2, self._older * _LINE_BYTES if self.known else 0)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        # A new file's name is durable only with its folder.
        if fresh:
            sync_folder(self.path.parent)
        self.known, self._older = True, 1 - self._older


def _parsed(line: bytes) -> int | None:
    """Return the number of a valid line."""
    number, _, checksum = line.rstrip(b"\n").partition(b" ")
    if len(line) != _LINE_BYTES or not number.isdigit() or checksum != b"%08x" % zlib.crc32(number):
        return None
    return int(number)
