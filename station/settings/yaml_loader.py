"""YAML loader for untrusted files: plain values with their lines, or all problems at once.

PyYAML's parser gives the events; their meaning is decided here, so that nothing of YAML 1.1's types, tags or references
is ever constructed.
"""

import errno
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from yaml import events

from station.settings.problems import Path as Where
from station.settings.problems import Problem, SettingsError, dotted, shortened
from station.settings.scalars import MeaningError, plain_scalar

LARGEST_FILE_BYTES = 64 * 1024
DEEPEST = 12
MOST_VALUES = 5_000
MOST_PROBLEMS = 50


@dataclass(frozen=True, slots=True)
class Document:
    """Content of a file: mappings, lists, texts, numbers, truth values and None, with the line of each."""

    source: str
    value: Any
    lines: dict[Where, int]
    """The line, counted from 1, on which each value (or its key) begins."""
    problems: tuple[Problem, ...] = ()
    doubtful: frozenset[Where] = field(default=frozenset())
    """Places of the problems: their values are stopgaps, exempt from further checks."""

    def locate(self, path: Where) -> tuple[str, str]:
        """Return `file:line` of a value, or of the innermost existing parent; and its dotted name.

        Args:
            path: keys and positions.
        """
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        return f"{self.source}:{self.lines.get(known, 1)}", dotted(path)


def read_document(path: Path) -> Document:
    """Read a file.

    Args:
        path: a regular file of at most `LARGEST_FILE_BYTES`, UTF-8, with or without a byte order mark.

    Raises:
        SettingsError: the file cannot be read. Problems of its content are in the document's `problems`.
    """
    return parse_document(_content(path), shortened(str(path), 1000))


def parse_document(content: bytes, source: str) -> Document:
    """Parse a file's content.

    Args:
        content: the bytes.
        source: the file's name for messages.
    """
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        bad = Problem(f"{source}:{line}", "file", f"expected UTF-8 text, got the byte 0x{content[error.start]:02x}")
        return Document(source, None, {}, (bad,), frozenset({()}))
    return _Composer(text, source).document()


def _content(path: Path) -> bytes:
    """Read the bytes of a regular file, without ever waiting for a pipe or a device."""
    source = shortened(str(path), 1000)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            mode = os.fstat(descriptor).st_mode
            if not stat.S_ISREG(mode):
                raise SettingsError([Problem(f"{source}:1", "file", f"expected a regular file, got {_kind(mode)}")])
            content = file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        raise SettingsError([Problem(f"{source}:1", "file", _unreadable(error))]) from error
    if len(content) > LARGEST_FILE_BYTES:
        problem = f"expected at most {LARGEST_FILE_BYTES // 1024} KiB, got more: is this the right file?"
        raise SettingsError([Problem(f"{source}:1", "file", problem)])
    return content


def _kind(mode: int) -> str:
    """Describe a path that is not a file."""
    return "a folder" if stat.S_ISDIR(mode) else "a pipe" if stat.S_ISFIFO(mode) else "a device"


def _unreadable(error: OSError | ValueError) -> str:
    """Describe why a file cannot be opened."""
    if isinstance(error, IsADirectoryError):
        return "expected a regular file, got a folder"
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    remedy = {errno.ENOENT: ": is the name right?", errno.EACCES: ": give the station's user the right to read it"}
    return f"expected a readable file: {reason.lower()}{remedy.get(getattr(error, 'errno', 0) or 0, '')}"


class _Abandoned(Exception):  # noqa: N818 (a signal inside this file, never an error outside)
    """Parsing cannot continue; the reason is among the problems."""


class _Composer:
    """Converts the parser's events to plain values, with lines and problems."""

    def __init__(self, text: str, source: str) -> None:
        self._text = text
        self._source = source
        self._lines: dict[Where, int] = {}
        self._problems: list[Problem] = []
        self._doubtful: set[Where] = set()
        self._values = 0

    def document(self) -> Document:
        """Compose the only document; an empty file is None."""
        value = None
        try:
            value = self._only_document(self._events())
        except _Abandoned:
            self._doubtful.add(())
        except yaml.YAMLError as error:
            self._syntax(error)
        found = tuple(self._problems)
        return Document(self._source, value, self._lines, found, frozenset(self._doubtful))

    def _events(self) -> Iterator[events.Event]:
        """Yield the parser's events."""
        loader = yaml.SafeLoader(self._text)
        while True:
            try:
                event = loader.get_event() if loader.check_event() else None
            except (ValueError, OverflowError):  # PyYAML passes \UFFFFFFFF to chr() unchecked
                self._note((), loader.line + 1, "expected characters that exist in Unicode")
                raise _Abandoned from None
            if event is None:
                return
            yield event

    def _only_document(self, stream: Iterator[events.Event]) -> Any:
        """Return the value of the stream's one document."""
        value = None
        documents = 0
        for event in stream:
            if isinstance(event, events.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self._note((), _line(event), "expected one YAML document, got a second one: remove the '---'")
                    raise _Abandoned
            elif isinstance(event, events.NodeEvent):
                value = self._value(event, stream, ())
        return value

    def _value(self, event: events.Event, stream: Iterator[events.Event], path: Where) -> Any:
        """Return the value that begins with an event."""
        self._lines.setdefault(path, _line(event))
        self._values += 1
        if self._values > MOST_VALUES:
            self._note((), _line(event), f"expected at most {MOST_VALUES} values")
            raise _Abandoned
        if isinstance(event, events.AliasEvent):
            self._note(path, _line(event), f"expected a value, got the alias *{shortened(event.anchor)}: write it out")
            return None
        anchor: str | None = getattr(event, "anchor", None)
        if anchor is not None:
            self._note(path, _line(event), f"expected no anchor, got &{shortened(anchor)}: remove it")
        tag: str | None = getattr(event, "tag", None)
        if tag is not None:
            self._note(path, _line(event), f"expected no tag, got {shortened(tag)}: remove it")
        if isinstance(event, events.ScalarEvent):
            return self._scalar(event, path)
        if len(path) >= DEEPEST:
            self._note(path[:3], _line(event), f"expected at most {DEEPEST} levels of nesting")
            raise _Abandoned
        if isinstance(event, events.SequenceStartEvent):
            return self._sequence(stream, path)
        return self._mapping(stream, path)

    def _sequence(self, stream: Iterator[events.Event], path: Where) -> list[Any]:
        """Return the items up to the list's end."""
        items: list[Any] = []
        while not isinstance(event := next(stream), events.SequenceEndEvent):
            items.append(self._value(event, stream, (*path, len(items))))
        return items

    def _mapping(self, stream: Iterator[events.Event], path: Where) -> dict[str, Any]:
        """Return the entries up to the mapping's end; of a doubled key the first is retained."""
        entries: dict[str, Any] = {}
        while not isinstance(event := next(stream), events.MappingEndEvent):
            line = _line(event)
            key = self._key(event, stream, path)
            if key is None:
                self._value(next(stream), stream, (*path, "?"))
                continue
            here = (*path, key)
            if key in entries:
                self._note(here, line, f"expected once, got it again: it is on line {self._lines[here]} already")
                self._value(next(stream), stream, here)
                continue
            self._lines[here] = line
            entries[key] = self._value(next(stream), stream, here)
        return entries

    def _key(self, event: events.Event, stream: Iterator[events.Event], path: Where) -> str | None:
        """Return a mapping's key, or None if it is not a plain text."""
        if not isinstance(event, events.ScalarEvent):
            self._note(path, _line(event), "expected a key that is a plain text")
            self._value(event, stream, (*path, "?"))
            return None
        if event.style is None and event.value == "<<":
            self._note(path, _line(event), "expected a key, got the merge key <<: write the entries out")
            return None
        here = (*path, shortened(event.value) or "?")
        if event.anchor is not None or event.tag is not None:
            self._note(here, _line(event), "expected a key without anchor or tag")
            return None
        before = len(self._problems)
        key = self._scalar(event, here)
        if isinstance(key, str):
            return key
        if len(self._problems) == before:
            self._note(here, _line(event), f"expected a key that is a text, got {shortened(event.value) or 'nothing'}")
        return None

    def _scalar(self, event: events.ScalarEvent, path: Where) -> Any:
        """Return a text, number, truth value or None."""
        if event.style is not None:
            if any("\ud800" <= character <= "\udfff" for character in event.value):
                self._note(path, _line(event), "expected characters that exist in Unicode")
                return None
            return event.value
        try:
            return plain_scalar(event.value)
        except MeaningError as error:
            self._note(path, _line(event), str(error))
            return None

    def _syntax(self, error: yaml.YAMLError) -> None:
        """Describe a syntax error of the parser."""
        self._doubtful.add(())
        if isinstance(error, yaml.MarkedYAMLError):
            mark = error.problem_mark or error.context_mark
            line = mark.line + 1 if mark else 1
            what = error.problem or error.context or "no YAML"
            if mark and self._text[mark.index : mark.index + 1] == "\t":
                self._note((), line, "expected spaces, got a tab")
            else:
                self._note((), line, f"expected valid YAML: {shortened(what, 200)}")
            return
        line = self._text.count("\n", 0, getattr(error, "position", 0)) + 1
        self._note((), line, "expected printable text, got a control character")

    def _note(self, path: Where, line: int, expected: str) -> None:
        """Add a problem, up to the readable number."""
        self._doubtful.add(path)
        if len(self._problems) >= MOST_PROBLEMS:
            self._problems[-1] = Problem(f"{self._source}:{line}", "file", "and more: mend these first")
            raise _Abandoned
        self._problems.append(Problem(f"{self._source}:{line}", dotted(path), expected))


def _line(event: events.Event) -> int:
    """Return the line of an event's begin, counted from 1."""
    return event.start_mark.line + 1
