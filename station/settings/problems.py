"""What is wrong in a file or in the environment, each thing with its place."""

from collections.abc import Iterable
from typing import NamedTuple

from station.errors import BadInputError

Path = tuple[str | int, ...]
"""Where a value stands in nested mappings and lists: keys and positions, outermost first."""


def dotted(path: Path) -> str:
    """A path in the words of a message: `steps.result_closings_mm[2]`, or `file` for the whole.

    Args:
        path: keys and positions.
    """
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{shortened(part)}" if text else shortened(part)
    return text or "file"


def shortened(text: str, longest: int = 60) -> str:
    """A text that fits a message's line, with everything unprintable escaped.

    Args:
        text: any text.
        longest: characters kept.
    """
    if len(text) > longest:
        text = text[: longest - 1] + "…"
    return text if text.isprintable() else text.encode("unicode_escape").decode()


class Problem(NamedTuple):
    """One thing to mend; its text is `place: field: what was expected`."""

    place: str
    field: str
    expected: str

    def __str__(self) -> str:
        return f"{self.place}: {self.field}: {self.expected}"


class SettingsError(BadInputError):
    """Everything that is wrong with the settings, one problem a line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


class Contradiction(ValueError):  # noqa: N818 (pydantic's validators raise it; it reaches users as problems)
    """Fields that are right one by one and wrong together; each with the path from the model that says so."""

    def __init__(self, parts: Iterable[tuple[Path, str]]) -> None:
        self.parts = tuple(parts)
        super().__init__("; ".join(f"{dotted(path)}: {text}" for path, text in self.parts))
