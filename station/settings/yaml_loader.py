"""YAML loader for untrusted files: plain values with their lines, or the problems.

PyYAML reads; it constructs no object. A plain word is accepted where YAML 1.1, PyYAML's, and the core schema of YAML
1.2.2 (section 10.3.2), an editor's, read it alike: `NO`, `012`, `1e3`, `1:30`, `1_000` or a date they do not.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from yaml.reader import ReaderError

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.file_content import read_content
from station.settings.problems import Path as Where
from station.settings.problems import Problem, field_name, shortened, shortened_file
from station.settings.schema import found

DEEPEST = 12
MOST_VALUES = 10_000
MOST_DIGITS = 18

_ALIKE = {
    "null": re.compile(r"null|Null|NULL|~|"),
    "bool": re.compile(r"true|True|TRUE|false|False|FALSE"),
    "int": re.compile(r"[-+]?(0|[1-9][0-9]{0,17})|0x[0-9a-fA-F]{1,15}"),
    "float": re.compile(r"[-+]?([0-9]{1,18}\.[0-9]{0,20}|\.[0-9]{1,20})([eE][-+][0-9]{1,2})?"),
}
"""Words of each kind of PyYAML's that mean the same in both versions."""
_NUMBER_OF_1_2 = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|0o[0-7]+")
_HALF_CHARACTER = re.compile("[\ud800-\udfff]")


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

    def locate(self, path: Where) -> tuple[Message, Message]:
        """Return `file:line` of a value, or of the innermost existing parent; and its dotted name."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        return messages.LINE(file=self.source, line=self.lines.get(known, 1)), field_name(path)


def read_document(path: Path) -> Document:
    """Read a file, as `read_content`.

    Raises:
        SettingsError: the file cannot be read. Problems of its content are in the document's `problems`.
    """
    return parse_document(read_content(path), shortened_file(path))


def parse_document(content: bytes, source: str) -> Document:
    """Parse a file's content, named by `source` in messages; an empty one is None."""
    try:
        reader = _Reader(content.decode("utf-8-sig"))
        node = reader.get_single_node()
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        line, expected = _refusal(error, content.decode("utf-8-sig", "replace"))
        return Document(source, None, {}, (_problem(source, (), line, expected),), frozenset({()}))
    value = None if node is None else reader.plain(node, ())
    problems = tuple(_problem(source, *each) for each in reader.found)
    return Document(source, value, reader.lines, problems, frozenset(path for path, _, _ in reader.found))


def _problem(source: str, path: Where, line: int, expected: Message) -> Problem:
    return Problem(messages.LINE(file=source, line=line), field_name(path), expected)


class _RefusedError(yaml.MarkedYAMLError):
    """Something of YAML that no settings file needs."""

    def __init__(self, mark: yaml.Mark, expected: Message) -> None:
        self.expected = expected
        super().__init__(problem_mark=mark)


def _refusal(error: Exception, text: str) -> tuple[int, Message]:
    """Return the line of what cannot be read, and what was expected there."""
    match error:
        case _RefusedError(problem_mark=yaml.Mark() as mark):
            return mark.line + 1, error.expected
        case yaml.MarkedYAMLError(problem_mark=yaml.Mark() as mark):
            words = shortened(f"{error.context or ''} {error.problem or ''}".strip(), 200)
            is_tab = text[mark.index : mark.index + 1] == "\t"
            return mark.line + 1, messages.TAB() if is_tab else messages.NOT_YAML(error=words)
        case UnicodeDecodeError(start=start):
            return error.object.count(b"\n", 0, start) + 1, messages.NOT_UTF8(byte=f"{error.object[start]:02x}")
    position = error.position if isinstance(error, ReaderError) else 0
    return text.count("\n", 0, position) + 1, messages.NOT_PRINTABLE()


class _Reader(yaml.SafeLoader):
    """PyYAML's nodes as plain values, with their lines and problems."""

    NON_PRINTABLE = re.compile("[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # pyrefly: ignore[bad-override] (final)
    """As PyYAML's, with the characters that break lines in YAML 1.1 only."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.lines: dict[Where, int] = {}
        self.found: list[tuple[Where, int, Message]] = []
        self._depth = self._values = 0

    def get_single_node(self) -> yaml.Node | None:
        """Compose the only document."""
        try:
            return super().get_single_node()
        except (ValueError, OverflowError):  # PyYAML passes \\UFFFFFFFF to chr() unchecked
            raise _RefusedError(self.get_mark(), messages.NOT_UNICODE()) from None

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node; refuse references and tags, and what is too deep or too much."""
        event = self.peek_event()
        mark, tag = event.start_mark, getattr(event, "tag", None)
        if event.anchor is not None:
            tag = ("*" if isinstance(event, yaml.AliasEvent) else "&") + event.anchor
        if tag is not None:
            raise _RefusedError(mark, messages.NOT_PLAIN(found=shortened(tag)))
        self._depth += 1
        self._values += 1
        if self._depth > DEEPEST:
            raise _RefusedError(mark, messages.TOO_DEEP(levels=DEEPEST))
        if self._values > MOST_VALUES:
            raise _RefusedError(mark, messages.TOO_MANY(number=MOST_VALUES))
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def plain(self, node: yaml.Node, path: Where) -> Any:
        """Return a node's value; of a doubled key the first."""
        self.lines.setdefault(path, _line(node))
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.plain(item, (*path, place)) for place, item in enumerate(node.value)]
        entries: dict[str, Any] = {}
        for key, value in node.value:
            here = (*path, key.value or "?") if isinstance(key, yaml.ScalarNode) else path
            before = len(self.found)
            name = self.plain(key, here)
            if isinstance(name, str) and name in entries:
                self._note(here, key, messages.TWICE(line=self.lines[here]))
            elif isinstance(name, str):
                entries[name] = self.plain(value, here)
            elif len(self.found) == before:
                self._note(here, key, messages.KEY(found=found(name)))
        return entries

    def _scalar(self, node: yaml.ScalarNode, path: Where) -> str | int | float | bool | None:
        word, kind = node.value, node.tag.rpartition(":")[2]
        if kind == "str" and (node.style is not None or not _NUMBER_OF_1_2.fullmatch(word)):
            if _HALF_CHARACTER.search(word):
                self._note(path, node, messages.NOT_UNICODE())
            return word
        if kind not in _ALIKE or not _ALIKE[kind].fullmatch(word):
            self._note(path, node, _other(shortened(word, 40), kind))
            return None
        if kind in {"null", "bool"}:
            return None if kind == "null" else word.lower() == "true"
        return int(word, 0) if kind == "int" else float(word)

    def _note(self, path: Where, node: yaml.Node, expected: Message) -> None:
        self.found.append((path, _line(node), expected))


def _line(node: yaml.Node) -> int:
    return node.start_mark.line + 1


def _other(word: str, kind: str) -> Message:
    """Describe a word with two meanings, or a number without a finite one, and what to write."""
    if kind == "bool":
        return messages.OTHER_SWITCH(word=word)
    if kind in {"int", "float", "str"}:
        return messages.OTHER_NUMBER(word=word, digits=MOST_DIGITS)
    return messages.OTHER_WORD(word=word)
