"""Atomic and durable replacement of a file."""

import contextlib
import os
import tempfile
from pathlib import Path

PARTIAL = ".partial"
"""Suffix of a file that is not complete; one that a killed process left may be removed."""


def write_atomically(
    path: Path, data: bytes, mode: int = 0o644, *, owner: tuple[int, int] | None = None, durable: bool = True
) -> None:
    """Replace a file as a whole: a reader, or whoever comes after a kill or a loss of power, finds the old or the new.

    Args:
        path: in an existing folder.
        data: the new content.
        mode: the new file's permissions.
        owner: user and group of the new file; the process's own by default.
        durable: wait for the disk; without it a loss of power may bring the old content back, or an empty file.

    Raises:
        OSError: it cannot be written; the old file is as it was.
    """
    descriptor, partial = tempfile.mkstemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fchmod(file.fileno(), mode)
            if owner is not None:
                os.fchown(file.fileno(), *owner)
            if durable:
                os.fsync(file.fileno())
        Path(partial).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(partial).unlink()
        raise
    if durable:
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable.

    Raises:
        OSError: they may not be durable.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
