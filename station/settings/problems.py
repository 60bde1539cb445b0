"""Problems of a file or of the environment, each with its place."""

from collections.abc import Iterable
from typing import NamedTuple

from station.errors import BadInputError

Path = tuple[str | int, ...]
"""Path of a value in nested mappings and lists: keys and positions, outermost first."""


def dotted(path: Path) -> str:
    """Return a path for a message: `steps.result_closings_mm[2]`, or `file` for the whole.

    Args:
        path: keys and positions.
    """
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{shortened(part)}" if text else shortened(part)
    return text or "file"


def shortened(text: str, longest: int = 60) -> str:
    """Return a text that fits a message's line, with everything unprintable escaped.

    Args:
        longest: maximum number of characters.
    """
    if len(text) > longest:
        text = text[: longest - 1] + "…"
    return text if text.isprintable() else text.encode("unicode_escape").decode()


class Problem(NamedTuple):
    """One problem; its text is `place: field: what was expected`."""

    place: str
    field: str
    expected: str

    def __str__(self) -> str:
        return f"{self.place}: {self.field}: {self.expected}"


class SettingsError(BadInputError):
    """All problems of the settings, one per line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class Contradiction(ValueError):  # noqa: N818 (pydantic's validators raise it; it reaches users as problems)
    """Fields that are valid one by one and wrong together; each with its path in the model."""

    def __init__(self, parts: Iterable[tuple[Path, str]]) -> None:
        self.parts = tuple(parts)
        super().__init__("; ".join(f"{dotted(path)}: {text}" for path, text in self.parts))
