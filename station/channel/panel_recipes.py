"""Messages of the recipes page: a person's changes."""

from typing import Annotated

from pydantic import Field

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.channel.panel_lots import Why

LARGEST_TEXT = 100_000
"""Letters of a recipe's file."""

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
Revision = Annotated[int, Field(ge=1, le=2**31)]
Scalar = bool | int | float | str | None


class RecipeOrder(ChannelMessage):
    """A person's change of one recipe. Answered with `Noted`."""

    name: Name
    reason: Why
    actor: Actor


class SaveDraft(RecipeOrder):
    """Change values in a recipe's file, with its comments, and record it as a draft.

    Refused as a whole if the recipe would be invalid, or has changed since the author read it.
    """

    values: dict[Annotated[str, Field(max_length=100)], Scalar | list[float]] = Field(min_length=1, max_length=200)
    """New values by their dotted paths, as `damage.area[0].area_mm2`."""
    base: str = Field(pattern=r"^[0-9a-f]{64}$")
    """The version that the author read."""


class SubmitRecipe(RecipeOrder):
    """Record a recipe's file as it is as a draft."""


class ApproveRecipe(RecipeOrder):
    """Put a draft in force for the next lot; its author cannot."""

    revision: Revision


class RejectRecipe(RecipeOrder):
    """Retire a draft: it is not put in force."""

    revision: Revision


class RevertRecipe(RecipeOrder):
    """Put a revision's text back into the recipe's file."""

    revision: Revision | None = None
    """None for the approved one."""


class ImportRecipe(ChannelMessage):
    """Replace a recipe's file by a whole recipe, and record it as a draft. Answered with `ImportedRecipe`."""

    text: str = Field(min_length=1, max_length=LARGEST_TEXT)
    reason: Why
    actor: Actor


class ImportedRecipe(ChannelMessage):
    """An imported recipe."""

    name: str
