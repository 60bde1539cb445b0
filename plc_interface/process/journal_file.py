"""Journal file of the handshake."""

import contextlib
import errno
import fcntl
import logging
import os
import time
from pathlib import Path

from pydantic import ValidationError

from plc_interface.handshake.journal import Journal
from station.atomic_file import write_atomically
from station.errors import BadInputError, StationError
from station.messages import line as messages
from station.messages.message import Message

log = logging.getLogger(__name__)

_RESERVE_BYTES = 1 << 20
"""Twenty of the largest journals: 64 outcomes that the station has not noted take about 50 kB."""
_BLOCK_BYTES = 4096
"""A file system's; the reserve is released in such pieces, so that a program that fills the disk gets nothing of it."""


class JournalFile:
    """One file that is replaced as a whole, a reserve of space for it, and a lock that excludes a second interface.

    A full disk must not keep an outcome from the journal that the PLC is about to see: after a kill another one could
    take its place. So some of the reserve is given up then, and taken again once there is space.
    """

    def __init__(self, folder: Path) -> None:
        """Create the folder, which is of this file alone, and take the lock.

        Raises:
            StationError: the folder cannot be written, or another interface runs there.
        """
        self._folder = folder
        self._path = folder / "journal.json"
        self._reserve = folder / "reserve"
        self.trouble: Message | None = None
        """Error of the last write."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / "lock").open("w")
        except OSError as error:
            raise StationError(messages.JOURNAL_NOT_KEPT(folder=str(folder), error=str(error.strerror))) from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self._lock.close()
            raise BadInputError(messages.ANOTHER_INTERFACE(folder=str(folder))) from error
        self._take_reserve()

    def read(self) -> Journal:
        """Return the last journal; an empty one if there is none, or none that can be read."""
        try:
            return Journal.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return Journal()
        except (OSError, ValidationError) as error:
            aside = self._path.with_suffix(".damaged")
            with contextlib.suppress(OSError):
                self._path.replace(aside)
            log.error(  # noqa: TRY400 (the file is at fault, not the code)
                "the journal cannot be read (%s): it is put aside as %s; what is open is asked of the station",
                type(error).__name__,
                aside,
            )
            return Journal(boots=int(time.time()) % 2**16)  # a number other than the last one

    def write(self, journal: Journal, *, durable: bool) -> None:
        """Replace the file; a failure is logged and stored in `trouble`: the line goes on.

        Args:
            durable: wait for the disk, so that it outlives a loss of power too.
        """
        try:
            # Fields with their default value are left out: an older version, which refuses unknown fields, then still
            # reads the journal.
            self._replace(journal.model_dump_json(exclude_defaults=True).encode(), durable=durable)
        except OSError as error:
            trouble = messages.JOURNAL_NOT_WRITTEN(file=str(self._path), error=str(error.strerror))
            if trouble != self.trouble:
                log.error("%s", trouble)  # noqa: TRY400 (the disk is at fault, not the code)
            self.trouble = trouble
        else:
            self.trouble = None
            self._take_reserve()

    def close(self) -> None:
        """Release the lock. Idempotent."""
        self._lock.close()

    def _replace(self, data: bytes, *, durable: bool) -> None:
        while True:
            try:
                write_atomically(self._path, data, durable=durable)
            except OSError as error:
                if error.errno not in {errno.ENOSPC, errno.EDQUOT} or not self._shrink_reserve():
                    raise
            else:
                return

    def _shrink_reserve(self) -> bool:
        """Give up some of the reserve; False where none is left."""
        try:
            size = self._reserve.stat().st_size
            os.truncate(self._reserve, max(0, size - _BLOCK_BYTES))
        except OSError:
            return False
        return size > 0

    def _take_reserve(self) -> None:
        """Take what is missing of the reserve, as far as there is space."""
        with contextlib.suppress(OSError), self._reserve.open("ab") as file:
            for size in range(file.tell() + _BLOCK_BYTES, _RESERVE_BYTES + 1, _BLOCK_BYTES):
                os.posix_fallocate(file.fileno(), 0, size)
