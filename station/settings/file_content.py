"""Content of a settings file: bytes of a regular file of limited size."""

import stat
from pathlib import Path

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.problems import Problem, SettingsError, shortened_file

LARGEST_FILE_BYTES = 64 * 1024


def read_content(path: Path) -> bytes:
    """Read the bytes of a regular file of at most `LARGEST_FILE_BYTES`, UTF-8 with or without a byte order mark.

    Raises:
        SettingsError: it cannot be read.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # opening a pipe would wait for its other end
            raise SettingsError([_problem(path, messages.NOT_A_FILE())])
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except FileNotFoundError as error:
        raise SettingsError([_problem(path, messages.NOT_FOUND())]) from error
    except PermissionError as error:
        raise SettingsError([_problem(path, messages.NOT_PERMITTED())]) from error
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise SettingsError([_problem(path, messages.UNREADABLE(error=reason.lower()))]) from error
    check_size(content, path)
    return content


def check_size(content: bytes, path: Path) -> None:
    """Refuse a file's content that `read_content` would not take.

    Raises:
        SettingsError: it is too large.
    """
    if len(content) > LARGEST_FILE_BYTES:
        raise SettingsError([_problem(path, messages.TOO_LARGE(limit_kib=LARGEST_FILE_BYTES // 1024))])


def _problem(path: Path, expected: Message) -> Problem:
    return Problem(messages.LINE(file=shortened_file(path), line=1), messages.FILE(), expected)
