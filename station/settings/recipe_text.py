"""Edits of a recipe's YAML text by a program, with its comments retained."""

import re
from collections.abc import Mapping
from typing import Any

from station.errors import BadInputError
from station.messages import settings as messages
from station.settings.commented_text import CommentedText
from station.settings.problems import shortened
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import parse_recipe, upgrade

_PART = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d{1,3})\]|(\d{1,3})", re.ASCII)
_PATH = re.compile(r"[A-Za-z_]\w*(\.([A-Za-z_]\w*|\d{1,3})|\[\d{1,3}\])*", re.ASCII)


def with_values(
    text: str, changes: Mapping[str, Any], source: str, comments: Mapping[str, str] | None = None
) -> tuple[str, Recipe]:
    """Return a recipe's text with some values changed, checked as a whole.

    Args:
        text: a valid recipe's YAML.
        changes: new values by their dotted paths, as `damage.area[0].area_mm2`; the enclosing structure has to exist.
        source: the text's name for messages.
        comments: of changed values, by their paths, in the place of those behind them, which were of the old values.

    Raises:
        BadInputError: there is no such value, or the recipe would be invalid; all problems.
    """
    commented = _commented(text, source)
    upgrade(commented.values)
    for path, value in changes.items():
        _set(commented.values, path, value)
    for path, comment in (comments or {}).items():
        values, key = _place(commented.values, path)
        commented.comment(values, key, comment)
    changed = commented.written()
    return changed, parse_recipe(changed, source)


def upgraded_text(text: str, source: str) -> tuple[str, int] | None:
    """Migrate a recipe's YAML text of an earlier schema version.

    Returns:
        The new text, a valid recipe's, and its earlier schema version; None if it has the present one.

    Raises:
        BadInputError: it is no valid recipe of its version.
    """
    commented = _commented(text, source)
    found = upgrade(commented.values)
    if found is None:
        return None
    changed = commented.written()
    parse_recipe(changed, source)
    return changed, found


def _commented(text: str, source: str) -> CommentedText:
    parse_recipe(text, source)
    return CommentedText(text.encode(), source, list_indent=2)


def _set(values: Any, path: str, value: Any) -> None:
    try:
        enclosing, key = _place(values, path)
        enclosing[key] = value  # one that no recipe has is refused with the whole
    except (KeyError, IndexError, TypeError):
        raise BadInputError(messages.NO_SUCH_VALUE(path=shortened(path))) from None


def _place(values: Any, path: str) -> tuple[Any, Any]:
    """The structure that holds a value, and the value's key there."""
    if not _PATH.fullmatch(path):  # what is not understood may be what names another value, as the minus of [-1]
        raise KeyError(path)
    parts = [int(match[2] or match[3]) if match[1] is None else match[1] for match in _PART.finditer(path)]
    for part in parts[:-1]:
        values = values[part]
    return values, parts[-1]
