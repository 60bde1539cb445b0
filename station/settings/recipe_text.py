"""Edits of a recipe's YAML text by a program, with its comments retained."""

import io
import re
from collections.abc import Mapping
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from station.errors import BadInputError
from station.settings.problems import Problem, SettingsError, shortened
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import SCHEMA_VERSION, parse_recipe, upgrade

_PART = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d{1,3})\]|(\d{1,3})")
_WIDE = 4096


def with_values(text: str, changes: Mapping[str, Any], source: str) -> tuple[str, Recipe]:
    """Return a recipe's text with some values changed, checked as a whole.

    Args:
        text: a valid recipe's YAML.
        changes: new values by their dotted paths, as `damage.area[0].area_mm2`; the enclosing structure has to exist.
        source: the text's name for messages.

    Raises:
        BadInputError: there is no such value, or the recipe would be invalid; all problems.
    """
    yaml, values = _round_trip(text, source)
    upgrade(values)
    for path, value in changes.items():
        _set(values, path, value)
    changed = _dumped(yaml, values)
    return changed, parse_recipe(changed, source)


def upgraded_text(text: str, source: str) -> tuple[str, int] | None:
    """Migrate a text of an earlier schema version.

    Args:
        text: YAML.
        source: the text's name for messages.

    Returns:
        The new text, a valid recipe's, and its earlier schema version; None if it has the present one.

    Raises:
        BadInputError: it is no valid recipe of its version.
    """
    yaml, values = _round_trip(text, source)
    found = upgrade(values)
    if found is None:
        return None
    changed = _dumped(yaml, values)
    parse_recipe(changed, f"{source} in form {SCHEMA_VERSION}")
    return changed, found


def _round_trip(text: str, source: str) -> tuple[YAML, Any]:
    parse_recipe(text, source)
    yaml = YAML(typ="rt")
    yaml.preserve_quotes = True
    yaml.width = _WIDE
    yaml.indent(mapping=2, sequence=4, offset=2)
    try:
        return yaml, yaml.load(text)
    except YAMLError as error:
        message = f"expected text that can be changed with its comments kept: {shortened(str(error), 200)}"
        raise SettingsError([Problem(source, "file", message)]) from error


def _dumped(yaml: YAML, values: Any) -> str:
    text = io.StringIO()
    yaml.dump(values, text)
    return text.getvalue()


def _set(values: Any, path: str, value: Any) -> None:
    parts = [int(match[2] or match[3]) if match[1] is None else match[1] for match in _PART.finditer(path)]
    try:
        for part in parts[:-1]:
            values = values[part]
        values[parts[-1]] = value  # one that no recipe has is refused with the whole
    except (KeyError, IndexError, TypeError):
        raise BadInputError(
            f"{shortened(path)}: expected the path of a value in the recipe's file, as damage.area[0].area_mm2"
        ) from None
