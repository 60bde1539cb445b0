"""Small files of the home folder that have to survive a crash in the middle of writing them."""

import contextlib
import logging
import os
import tempfile
from pathlib import Path

log = logging.getLogger(__name__)


class Kept:
    """A folder of such files. A file that cannot be read or written is logged, and never stops the station."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, name: str) -> bytes | None:
        """What a file holds; None where it is not there or cannot be read.

        Args:
            name: relative to the folder.
        """
        try:
            return (self.folder / name).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            log.warning("%s cannot be read: %s", self.folder / name, error.strerror)
            return None

    def write(self, name: str, data: bytes) -> bool:
        """Put a file in the place of the one there, whole or not at all.

        Args:
            name: relative to the folder.
            data: its content; nothing is written where the file holds it already.

        Returns:
            Whether it is there now.
        """
        path = self.folder / name
        if self.read(name) == data:
            return True
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, unfinished = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                Path(unfinished).replace(path)
            except OSError:
                with contextlib.suppress(OSError):
                    Path(unfinished).unlink()
                raise
        except OSError as error:
            log.warning("%s cannot be written: %s", path, error.strerror)
            return False
        return True
