"""The file `station.yaml` as text: reading, replacement with a copy of the former one, comparison by its settings."""

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import JsonValue

from station.atomic_file import write_atomically
from station.settings.file_content import read_content
from station.settings.yaml_loader import parse_document


def former(file: Path) -> Path:
    """Return the path of the former file: beside the file that a link leads to."""
    file = file.resolve()
    return file.with_name(f"{file.name}.former")


def read_text(file: Path) -> str:
    """Return a file's text; bytes that are no UTF-8 are marked.

    Raises:
        SettingsError: it cannot be read.
    """
    return read_content(file).decode("utf-8-sig", "replace")


def digest(text: str) -> str:
    """Return a name for a text, by which a page notices that the file was changed meanwhile."""
    return hashlib.sha256(text.encode()).hexdigest()


def replace(file: Path, text: str) -> None:
    """Keep the file as the former one, and put a text in its place; both atomically, with its permissions.

    Raises:
        OSError: it cannot be written; the file is as it was.
        SettingsError: it cannot be read.
    """
    file = file.resolve()
    mode = file.stat().st_mode & 0o7777
    write_atomically(former(file), read_content(file), mode)
    write_atomically(file, text.encode(), mode)


def changes(old: str, new: str) -> tuple[dict[str, JsonValue], dict[str, JsonValue]]:
    """Return the settings that differ, by their dotted names, as they were and as they are."""
    before, after = (dict(_leaves(parse_document(text.encode(), "").value, "")) for text in (old, new))
    names = [name for name in {**before, **after} if before.get(name) != after.get(name)]
    was, now = ({name: each[name] for name in names if name in each} for each in (before, after))
    return was, now


def _leaves(value: JsonValue, path: str) -> Iterator[tuple[str, JsonValue]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(inner, f"{path}.{name}" if path else name)
    elif path:
        yield path, value
