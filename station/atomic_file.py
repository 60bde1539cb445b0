"""Atomic and durable replacement of a file."""

import contextlib
import os
import secrets
from pathlib import Path

# No path with a name that is used only once goes through pathlib here: it interns every part of a path, and Python
# 3.12 before 3.12.7 never gives an interned string back (github.com/python/cpython/issues/113993).

PARTIAL = ".partial"
"""Suffix of a file that is not complete; one that a killed process left may be removed."""


def write_atomically(
    path: Path | str,
    data: bytes,
    mode: int | None = None,
    *,
    owner: tuple[int, int] | None = None,
    durable: bool = True,
) -> None:
    """Replace a file as a whole: a reader finds the old one or the new one, also after a kill or a loss of power.

    Args:
        path: in an existing folder.
        mode: the new file's permissions, exactly; by default those that the process's umask leaves.
        owner: user and group of the new file; the process's own by default.
        durable: wait for the disk; without it a loss of power may bring the old content back, or an empty file.

    Raises:
        OSError: it cannot be written; the old file is as it was.
    """
    folder, name = os.path.split(path)
    partial = os.path.join(folder, f".{name}.{secrets.token_hex(4)}{PARTIAL}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    descriptor = os.open(partial, flags, 0o666 if mode is None else 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            if owner is not None:
                os.fchown(file.fileno(), *owner)
            if durable:
                os.fsync(file.fileno())
        os.replace(partial, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(partial)
        raise
    if durable:
        sync_folder(folder or ".")


def sync_file(path: Path | str) -> None:
    """Make a file's content durable; its name is made so by `sync_folder`.

    Raises:
        OSError: it may not be durable.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path | str) -> None:
    """Make the names in a folder durable.

    Raises:
        OSError: they may not be durable.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
