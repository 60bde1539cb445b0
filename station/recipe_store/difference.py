"""Differences of two recipes, value by value."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from station.messages import recipes as messages
from station.messages.message import Message
from station.settings.problems import Path, dotted
from station.settings.recipe_model import Recipe

_ABSENT = "nothing"


class Difference(NamedTuple):
    """One different value."""

    path: str
    old: Any
    new: Any

    def __str__(self) -> str:
        return f"{self.path}: {self.old} → {self.new}"


def differences(old: Recipe, new: Recipe) -> tuple[Difference, ...]:
    """List every value of two recipes that differs, in the order of the file."""
    return tuple(_walk(old.model_dump(mode="json"), new.model_dump(mode="json"), ()))


def described_differences(old: Recipe, new: Recipe) -> Message:
    """Return the differences as a message."""
    changes = [messages.CHANGE(path=each.path, old=str(each.old), new=str(each.new)) for each in differences(old, new)]
    return messages.CHANGES(changes=changes) if changes else messages.NO_CHANGE()


def _walk(old: Any, new: Any, path: Path) -> Iterator[Difference]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            yield from _walk(old.get(key, _ABSENT), new.get(key, _ABSENT), (*path, key))
    elif isinstance(old, list) and isinstance(new, list) and any(isinstance(item, dict) for item in old + new):
        for place in range(max(len(old), len(new))):
            before, after = (items[place] if place < len(items) else _ABSENT for items in (old, new))
            yield from _walk(before, after, (*path, place))
    elif old != new:
        yield Difference(dotted(path), old, new)
