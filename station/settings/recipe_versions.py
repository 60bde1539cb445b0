"""Recipe schema versions: migration to the present one, parsing, and content hash."""

import hashlib
import json
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

from station.messages import settings as messages
from station.settings.problems import Problem
from station.settings.recipe_model import Recipe
from station.settings.validation import validated
from station.settings.yaml_loader import parse_document

SCHEMA_VERSION = 1
"""The `schema_version` that this program reads and writes."""

Migration = Callable[[MutableMapping[str, Any]], None]
MIGRATIONS: Mapping[int, Migration] = {}
"""By the schema version that each migrates from, to the next one; never changed once released. Each changes plain
values, or a text's values with their comments, in place; `schema_version` is raised by the caller."""


def parse_recipe(text: str, source: str) -> Recipe:
    """Parse a recipe from YAML of this or an earlier schema version.

    Raises:
        SettingsError: all problems of the recipe.
    """
    return recipe_of(text.encode(), source)


@lru_cache(maxsize=16)  # a start and each change of a file read every recipe four times
def recipe_of(content: bytes, source: str) -> Recipe:
    """Parse a recipe from a file's content, of this or an earlier schema version.

    Raises:
        SettingsError: all problems of the recipe.
    """
    document = parse_document(content, source)
    values = document.value
    form = values.get("schema_version") if isinstance(values, dict) else None
    if isinstance(form, int) and form > SCHEMA_VERSION:
        place, field = document.locate(("schema_version",))
        problem = Problem(place, field, messages.NEWER_SCHEMA(known=SCHEMA_VERSION, found=form))
        document = replace(document, problems=(problem,), doubtful=frozenset({()}))
    if isinstance(values, dict) and not document.problems:
        upgrade(values)
    return validated(Recipe, document, values, document.locate)


def upgrade(values: MutableMapping[str, Any]) -> int | None:
    """Migrate values of an earlier schema version to the present one, in place.

    Args:
        values: a recipe's, perhaps invalid: the validation that follows reports what a migration cannot find.

    Returns:
        Their schema version; None if there was nothing to do.
    """
    found = form = values.get("schema_version")
    if not isinstance(form, int) or form not in MIGRATIONS:
        return None
    while form in MIGRATIONS:
        MIGRATIONS[form](values)
        form += 1
        values["schema_version"] = form
    return found


def canonical_text(values: Mapping[str, Any]) -> str:
    """Return a recipe's values, as `Recipe.model_dump(mode="json")` gives them, as canonical JSON.

    It is the input of the recipe's hash and of the PLC's checksum, and what the records store.
    """
    return json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def content_sha256(recipe: Recipe) -> str:
    """Return the hash that identifies a recipe; comments and layout are no part of it."""
    return hashlib.sha256(canonical_text(recipe.model_dump(mode="json")).encode()).hexdigest()
