"""Revision of a recipe, and the errors of the recipe history."""

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

from station.errors import StationError
from station.messages import recipes as messages
from station.messages.message import Message, message_of
from station.recipe_store.difference import described_differences
from station.settings.problems import SettingsError
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import parse_recipe


class RecipeStoreError(StationError):
    """A request about recipes was refused; nothing was changed."""


class ConflictError(RecipeStoreError):
    """Another person has changed the recipe meanwhile; the message gives the change."""


class Status(StrEnum):
    """Status of a revision."""

    DRAFT = "draft"
    """Submitted, to be reviewed by another person."""
    APPROVED = "approved"
    """In force for inspections; at most one per recipe."""
    RETIRED = "retired"


STATUS = {
    Status.DRAFT: messages.DRAFT,
    Status.APPROVED: messages.APPROVED,
    Status.RETIRED: messages.RETIRED,
}
"""Names of the statuses."""


class Origin(StrEnum):
    """Origin of a revision."""

    SUBMITTED = "submitted"
    """By a person, from the recipe's file."""
    SHIPPED = "shipped"
    """With a distribution of the station, which approves it."""
    ADOPTED = "adopted"
    """It existed when the history began: the installer of the station is responsible for it."""


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
    """Its file unchanged, with comments."""
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
        """Return the recipe in this program's schema.

        Raises:
            SettingsError: this program does not accept it any more.
        """
        return _parsed(self.text, f"{self.name}@{self.revision}")

    def holds(self, recipe: Recipe) -> bool:
        """Check that its recipe is this one: never, where this program does not accept it any more."""
        try:
            return self.recipe == recipe
        except SettingsError:
            return False

    def changes_to(self, recipe: Recipe) -> Message:
        """Return the differences of a recipe from its own, or why its own cannot be read any more."""
        try:
            return described_differences(self.recipe, recipe)
        except SettingsError as error:
            return messages.REVISION_NOT_ACCEPTED(why=message_of(error))


@lru_cache(maxsize=256)
def _parsed(text: str, source: str) -> Recipe:
    """Parse a revision, cached: it never changes, and parsing takes some milliseconds."""
    return parse_recipe(text, source)
