"""Migration of a `station.yaml` from an earlier version, with its comments."""

import io
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from station.settings.problems import Problem, SettingsError, dotted

_WIDE = 4096


class Move(NamedTuple):
    """A setting with a new place. An old place is never reused."""

    old: tuple[str, ...]
    new: tuple[str, ...]


MOVES = (Move(("service", "channel"), ("handshake", "endpoint")),)


class Migrated(NamedTuple):
    """A migrated configuration."""

    text: str
    changes: tuple[str, ...]
    """The changes, one sentence each; empty for an unchanged text."""


def migrated(text: str, source: str) -> Migrated:
    """Move the settings of an earlier version to their new places. Idempotent.

    Args:
        text: the file's; `load_configuration` validates its values.
        source: the file's name for messages.

    Raises:
        SettingsError: it is no YAML mapping, or a setting is in its old and in its new place.
    """
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _WIDE
    try:
        values = yaml.load(text)
    except YAMLError as error:
        raise SettingsError([Problem(source, "file", f"expected YAML: {str(error).splitlines()[0]}")]) from error
    if values is None:
        return Migrated(text, ())
    if not isinstance(values, dict):
        raise SettingsError([Problem(source, "file", "expected settings by their names")])
    changes = tuple(_moved(values, move, source) for move in MOVES if _section(values, move.old) is not None)
    if not changes:
        return Migrated(text, ())
    written = io.StringIO()
    yaml.dump(values, written)
    return Migrated(written.getvalue(), changes)


def _section(values: Any, path: tuple[str, ...]) -> dict[str, Any] | None:
    """Return the mapping that has the setting, or None."""
    for part in path[:-1]:
        values = values.get(part) if isinstance(values, dict) else None
    return values if isinstance(values, dict) and path[-1] in values else None


def _moved(values: dict[str, Any], move: Move, source: str) -> str:
    old, new = dotted(move.old), dotted(move.new)
    if _section(values, move.new) is not None:
        raise SettingsError([Problem(source, old, f"is {new} now, which is there too: keep one of them, as {new}")])
    section = _section(values, move.old)
    assert section is not None  # noqa: S101 (the caller has looked)
    value = section.pop(move.old[-1])
    if not section:
        _drop(values, move.old[:-1])
    place = values
    for part in move.new[:-1]:
        if not isinstance(place.get(part), dict):
            place[part] = {}
        place = place[part]
    place[move.new[-1]] = value
    return f"{old} is {new} now"


def _drop(values: dict[str, Any], path: tuple[str, ...]) -> None:
    """Remove empty sections: `service:` alone would be a null."""
    for depth in range(len(path), 0, -1):
        section = _section(values, path[:depth])
        if section is None or section[path[depth - 1]]:
            return
        del section[path[depth - 1]]
