"""YAML text with its comments, for edits by a program: the loader's rules decide, ruamel.yaml writes."""

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from station.messages import settings as messages
from station.settings.problems import Problem, SettingsError, shortened
from station.settings.yaml_loader import parse_document

_WIDE = 4096


class CommentedText:
    """Values of a YAML text that are changed in place, and the text with them and its comments.

    Args:
        content: YAML that the loader accepts.
        source: its name for messages.
        list_indent: columns of a list's items behind their key.

    Raises:
        SettingsError: the loader's problems, or it cannot be written with its comments.
    """

    def __init__(self, content: bytes, source: str, *, list_indent: int = 0) -> None:
        document = parse_document(content, source)
        if document.problems:
            raise SettingsError(document.problems)
        self._yaml = YAML(typ="rt")
        self._yaml.preserve_quotes = True
        self._yaml.width = _WIDE
        self._yaml.indent(mapping=2, sequence=2 + list_indent, offset=list_indent)
        try:
            self.values: Any = self._yaml.load(content.decode("utf-8-sig"))
        except (YAMLError, ValueError) as error:  # it takes `.` and `_` for numbers
            raise _not_editable(source, str(error)) from error
        if self.values != document.value:  # such as a file that is one block of text: `>`, then `#`
            raise _not_editable(source, "it can be read in two ways")

    def comment(self, values: Any, key: str, text: str) -> None:
        """Put a one-line comment behind a mapping's value, in place of the one there; comments on own lines stay."""
        tokens = values.ca.items.get(key)
        if tokens is None or tokens[2] is None:
            values.yaml_add_eol_comment(text, key)
        else:  # the lines of their own that follow are in the same token
            tokens[2].value = f"# {text}\n" + tokens[2].value.partition("\n")[2]

    def written(self) -> str:
        """Return the text with the values as they are now."""
        text = io.StringIO()
        self._yaml.dump(self.values, text)
        return text.getvalue()


def _not_editable(source: str, why: str) -> SettingsError:
    expected = messages.NOT_EDITABLE(error=shortened(why, 200))
    return SettingsError([Problem(messages.PATH(path=source), messages.FILE(), expected)])
