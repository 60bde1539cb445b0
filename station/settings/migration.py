"""Migration of a `station.yaml` from an earlier version, with its comments."""

from typing import Any, NamedTuple

from station.messages import settings as messages
from station.settings.commented_text import CommentedText
from station.settings.earlier_settings import MOVES, WITHOUT_EFFECT, Move
from station.settings.problems import Problem, SettingsError, dotted, field_name


class Migrated(NamedTuple):
    """A migrated configuration."""

    text: str
    """Empty without changes."""
    changes: tuple[str, ...]
    """The changes, one sentence each."""


def migrated(content: bytes, source: str) -> Migrated:
    """Move the settings of an earlier version to their new places, and remove those that are gone. Idempotent.

    The values are not validated.

    Raises:
        SettingsError: it is no YAML mapping, or a setting is in its old and in its new place.
    """
    commented = CommentedText(content, source)
    values = commented.values
    if not isinstance(values, dict | None):
        raise SettingsError([Problem(messages.PATH(path=source), messages.FILE(), messages.NO_NAMES())])
    moved = (_moved(values, move, source) for move in MOVES if _section(values, move.old) is not None)
    changes = (*moved, *(_removed(values, path) for path in WITHOUT_EFFECT if _section(values, path) is not None))
    return Migrated(commented.written() if changes else "", changes)


def _section(values: Any, path: tuple[str, ...]) -> dict[str, Any] | None:
    """Return the mapping that has the setting, or None."""
    for part in path[:-1]:
        values = values.get(part) if isinstance(values, dict) else None
    return values if isinstance(values, dict) and path[-1] in values else None


def _moved(values: Any, move: Move, source: str) -> str:
    old, new = dotted(move.old), dotted(move.new)
    if _section(values, move.new) is not None:
        place, field = messages.PATH(path=source), field_name(move.old)
        raise SettingsError([Problem(place, field, messages.MOVED_TWICE(new=new))])
    section = _section(values, move.old)
    assert section is not None  # noqa: S101 (the caller has looked)
    value = section[move.old[-1]]
    _drop(values, move.old)
    place = values
    for part in move.new[:-1]:
        if not isinstance(place.get(part), dict):
            place[part] = {}
        place = place[part]
    place[move.new[-1]] = value
    return f"{old} is {new} now"


def _removed(values: Any, path: tuple[str, ...]) -> str:
    _drop(values, path)
    return f"{dotted(path)} is gone, as it has no effect any more"


def _drop(values: dict[str, Any], path: tuple[str, ...]) -> None:
    """Remove a setting, and sections that become empty: `service:` alone would be a null."""
    for depth in range(len(path), 0, -1):
        section = _section(values, path[:depth])
        if section is None or (depth < len(path) and section[path[depth - 1]]):
            return
        del section[path[depth - 1]]
