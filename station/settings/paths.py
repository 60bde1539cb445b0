"""Types of paths in settings; whether there is anything at a path is for whoever opens it to say."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator


def _plain(what: str) -> Callable[[Path], Path]:
    """Refuse the empty text, and what no file system or only a shell understands."""

    def check(path: Path) -> Path:
        if path == Path() or "\0" in str(path) or "~" in path.parts:
            raise ValueError(f"expected the path of a {what}, written out without ~")
        return path

    return check


Folder = Annotated[Path, AfterValidator(_plain("folder"))]
File = Annotated[Path, AfterValidator(_plain("file"))]
