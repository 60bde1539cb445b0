"""A recipe's text of any released form: brought to this program's form, read, and known by its content."""

import hashlib
import json
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import replace
from typing import Any

from station.settings.problems import Problem
from station.settings.recipe_model import Recipe
from station.settings.validation import validated
from station.settings.yaml_loader import Document, parse_document

FORM = 1
"""The `schema_version` that this program reads and writes."""

Migration = Callable[[MutableMapping[str, Any]], None]
MIGRATIONS: Mapping[int, Migration] = {}
"""By the form that each leads away from, to the next one; never changed once released. Each changes plain values, or a
text's values with their comments, in place; `schema_version` is raised by the caller."""


def parse_recipe(text: str, source: str) -> Recipe:
    """Read a recipe from its text.

    Args:
        text: YAML of this or an earlier form.
        source: the text's name for messages.

    Raises:
        SettingsError: all that is wrong with it.
    """
    return recipe_of(parse_document(text.encode(), source))


def recipe_of(document: Document) -> Recipe:
    """Read a recipe.

    Args:
        document: a file's content, of this or an earlier form.

    Raises:
        SettingsError: all that is wrong with it.
    """
    values = document.value
    form = values.get("schema_version") if isinstance(values, dict) else None
    if isinstance(form, int) and form > FORM:
        place, field = document.locate(("schema_version",))
        told = f"expected at most {FORM}, got {form} of a newer fruit-station: install that, or write the older form"
        problem = Problem(place, field, told)
        document = replace(document, problems=(problem,), doubtful=frozenset({()}))
    if isinstance(values, dict) and not document.problems:
        upgrade(values)
    return validated(Recipe, document, values, document.locate)


def upgrade(values: MutableMapping[str, Any]) -> int | None:
    """Bring values of an earlier form to this program's, in place.

    Args:
        values: a recipe's, perhaps bad ones: what a migration cannot find is left for the check that follows.

    Returns:
        The form that they had; None where nothing was to be done.
    """
    found = form = values.get("schema_version")
    if not isinstance(form, int) or form not in MIGRATIONS:
        return None
    while form in MIGRATIONS:
        MIGRATIONS[form](values)
        form += 1
        values["schema_version"] = form
    return found


def canonical_text(recipe: Recipe) -> str:
    """A recipe's values as JSON of one form only: what its hash and the PLC's checksum are made of.

    Args:
        recipe: as read.
    """
    values = recipe.model_dump(mode="json")
    return json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def content_sha256(recipe: Recipe) -> str:
    """The hash by which a recipe is known; comments and layout are no part of it.

    Args:
        recipe: as read.
    """
    return hashlib.sha256(canonical_text(recipe).encode()).hexdigest()
