"""Passwords from a file or the environment; never in the configuration, and in no message."""

import os
import stat
from pathlib import Path

from station.outbox.errors import OutboxError


def password(file: Path | None, variable: str) -> str | None:
    """Return the password; None if neither gives one.

    Args:
        file: its first line is read; only its owner may have access.
        variable: of the environment, if no file is named.

    Raises:
        OutboxError: the file cannot be read, or others can read it.
    """
    if file is None:
        return os.environ.get(variable)
    try:
        if stat.S_IMODE(file.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO):
            raise OutboxError(f"{file}: others than its owner can read the password", f"chmod 600 {file}")
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise OutboxError(f"{file}: the password cannot be read: {error}", "name a text file that it is in") from error
    if not lines or not lines[0]:
        raise OutboxError(f"{file}: its first line is empty", "write the password there")
    return lines[0]
