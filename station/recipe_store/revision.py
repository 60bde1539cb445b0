"""A recipe's revision, and what can be wrong with what is asked of the history."""

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

from station.errors import StationError
from station.settings.recipe_form import parse_recipe
from station.settings.recipe_model import Recipe


class RecipeStoreError(StationError):
    """What was asked of the recipes was not done, and nothing was changed."""


class ConflictError(RecipeStoreError):
    """Somebody else has changed the recipe meanwhile; the message says what."""


class Status(StrEnum):
    """Where a revision is in its life."""

    DRAFT = "draft"
    """Submitted, to be looked at by another person."""
    APPROVED = "approved"
    """The one by which fruit is inspected; at most one a recipe."""
    RETIRED = "retired"


class Origin(StrEnum):
    """Where a revision came from."""

    SUBMITTED = "submitted"
    """By a person, from the recipe's file."""
    SHIPPED = "shipped"
    """With a distribution of the station, which approves it."""
    ADOPTED = "adopted"
    """It was there when the history began: who installed the station answers for it."""


@dataclass(frozen=True, slots=True)
class Revision:
    """One revision of one recipe."""

    name: str
    revision: int
    """From 1."""
    number: int
    """The PLC's."""
    sha256: str
    """Of its values when it was recorded."""
    text: str
    """Its file as it was, with comments."""
    status: Status
    origin: Origin
    based_on: int | None
    """The revision that was approved when this one was submitted."""
    author: str
    reason: str
    created_utc_ms: int
    approver: str | None = None
    """Another person than the author."""
    approval_reason: str | None = None
    approved_utc_ms: int | None = None
    retired_by: str | None = None
    retired_reason: str | None = None
    retired_utc_ms: int | None = None

    @property
    def recipe(self) -> Recipe:
        """The recipe in this program's form.

        Raises:
            SettingsError: this program does not take it any more.
        """
        return _parsed(self.text, f"{self.name} revision {self.revision}")


@lru_cache(maxsize=256)
def _parsed(text: str, source: str) -> Recipe:
    """A revision never changes, and reading one takes some milliseconds."""
    return parse_recipe(text, source)
