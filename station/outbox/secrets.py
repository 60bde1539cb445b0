"""Passwords from a file or the environment; never in the configuration, and in no message."""

import os
import stat
from pathlib import Path

from station.messages import outbox as messages
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
            raise OutboxError(messages.PASSWORD_OPEN(file=str(file)), messages.CLOSE_PASSWORD(file=str(file)))
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        cause = messages.PASSWORD_UNREADABLE(file=str(file), error=str(error))
        raise OutboxError(cause, messages.NAME_PASSWORD_FILE()) from error
    if not lines or not lines[0]:
        raise OutboxError(messages.PASSWORD_EMPTY(file=str(file)), messages.WRITE_PASSWORD())
    return lines[0]
