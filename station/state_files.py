"""State files of the home folder, written so that a crash leaves the old or the new content."""

import logging
from pathlib import Path

from station.atomic_file import write_atomically

log = logging.getLogger(__name__)


class StateFiles:
    """Folder of state files. A file that cannot be read or written is logged, and never stops the station."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, name: str) -> bytes | None:
        """Return the content of a file in the folder; None if it is missing or cannot be read."""
        try:
            return (self.folder / name).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            log.warning("%s cannot be read: %s", self.folder / name, error.strerror)
            return None

    def is_missing(self, name: str) -> bool:
        """Return whether a file certainly does not exist; false where that cannot be found out."""
        try:
            (self.folder / name).lstat()
        except FileNotFoundError:
            return True
        except OSError:
            return False
        return False

    def write(self, name: str, data: bytes) -> bool:
        """Replace a file in the folder atomically, unless it has this content; return whether it has it now."""
        path = self.folder / name
        if self.read(name) == data:
            return True
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, data, 0o600)
        except OSError as error:
            log.warning("%s cannot be written: %s", path, error.strerror)
            return False
        return True
