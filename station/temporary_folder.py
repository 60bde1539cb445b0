"""Temporary folders named by the process that made them; a killed process's are removed by the next one's start."""

import os
import re
import shutil
import tempfile
from pathlib import Path


def make_temporary_folder(kind: str) -> tempfile.TemporaryDirectory[str]:
    """Make a folder for this process, 0700, and remove those of the same kind whose processes are gone.

    Args:
        kind: short, because a socket's path in it has 107 bytes at most.

    Raises:
        OSError: it cannot be made.
    """
    owned = re.compile(rf"{kind}-(\d{{1,9}})-.+")
    for folder in Path(tempfile.gettempdir()).glob(f"{kind}-*"):
        found = owned.fullmatch(folder.name)
        if found is not None and not _alive(int(found[1])):
            shutil.rmtree(folder, ignore_errors=True)
    return tempfile.TemporaryDirectory(prefix=f"{kind}-{os.getpid()}-", ignore_cleanup_errors=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        pass
    return True
