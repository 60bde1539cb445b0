"""Types of paths in settings; the reader of a path checks its existence."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

from station.messages import settings as messages
from station.messages.message import Definition
from station.settings.problems import WantedError

LONGEST_BYTES, LONGEST_NAME_BYTES = 1000, 255
"""Linux takes 4096 (limits.h, PATH_MAX) and 255 (NAME_MAX); the rest is left for the names inside a folder."""


def _plain(wanted: Definition) -> Callable[[Path], Path]:
    """Refuse the empty text, and characters that a file system refuses or only a shell interprets."""

    def check(path: Path) -> Path:
        if path == Path() or "\0" in str(path) or "~" in path.parts:
            raise WantedError(wanted())
        if len(os.fsencode(path)) > LONGEST_BYTES or any(len(os.fsencode(p)) > LONGEST_NAME_BYTES for p in path.parts):
            raise WantedError(messages.SHORT_PATH(bytes=LONGEST_BYTES, name_bytes=LONGEST_NAME_BYTES))
        return path

    return check


Folder = Annotated[Path, AfterValidator(_plain(messages.FOLDER_PATH))]
File = Annotated[Path, AfterValidator(_plain(messages.FILE_PATH))]
