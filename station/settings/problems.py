"""Problems of a file or of the environment, each with its place."""

from collections.abc import Iterable
from pathlib import Path as FilePath
from typing import NamedTuple

from station.errors import BadInputError
from station.messages import settings as messages
from station.messages.message import Message

MOST_PROBLEMS = 50
_LONGEST_FILE = 1000
"""Characters of a file's name with its folders that a message shows: what a person made is shorter."""
Path = tuple[str | int, ...]
"""Path of a value in nested mappings and lists: keys and positions, outermost first."""


def dotted(path: Path) -> str:
    """Return a path for a message: `steps.result_closings_mm[2]`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{shortened(part)}" for part in path)
    return "".join(parts).removeprefix(".")


def field_name(path: Path) -> Message:
    """Return the name of a value for a problem; of the empty path, the file's."""
    return messages.FIELD(path=dotted(path)) if path else messages.FILE()


def shortened(text: str, longest: int = 60) -> str:
    """Return a text of at most `longest` characters for a message's line, with everything unprintable escaped."""
    if len(text) > longest:
        text = text[: longest - 1] + "…"
    return text if text.isprintable() else text.encode("unicode_escape").decode()


def shortened_file(path: FilePath) -> str:
    """Return a file's or folder's name for a message's line."""
    return shortened(str(path), _LONGEST_FILE)


class Problem(NamedTuple):
    """One problem; its text is `place: field: what was expected`."""

    place: Message
    field: Message
    expected: Message

    @property
    def message(self) -> Message:
        """The whole problem."""
        return messages.PROBLEM(place=self.place, field=self.field, expected=self.expected)

    def __str__(self) -> str:
        return str(self.message)


class SettingsError(BadInputError):
    """All problems of the settings, one per line; of very many the first."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        if len(self.problems) > MOST_PROBLEMS:
            more = Problem(self.problems[MOST_PROBLEMS].place, messages.FILE(), messages.MORE())
            self.problems = (*self.problems[:MOST_PROBLEMS], more)
        super().__init__(messages.PROBLEMS(problems=[problem.message for problem in self.problems]))


class WantedError(ValueError):
    """A value that a field's validator refuses, with what it accepts."""

    def __init__(self, wanted: Message) -> None:
        self.wanted = wanted
        super().__init__(str(wanted))


class FieldError(ValueError):
    """Values that a model's validator refuses: the path of each inside the model, and what was expected."""

    def __init__(self, parts: Iterable[tuple[Path, Message]]) -> None:
        self.parts = tuple(parts)
        super().__init__("; ".join(f"{dotted(path)}: {expected}" for path, expected in self.parts))
