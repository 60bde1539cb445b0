"""Messages of the recipes page: state, differences, and a person's changes."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.channel.panel_queries import Text, Why
from station.messages.message import Message

LARGEST_TEXT = 100_000
"""Letters of a recipe's file."""
MOST_CURVES = 200

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
Revision = Annotated[int, Field(ge=1, le=2**31)]
Scalar = bool | int | float | str | None


class ListRecipes(ChannelMessage):
    """Query the state of all recipes."""

    purpose: ClassVar[str] = "for the recipes"


class RecipeRow(ChannelMessage):
    """State of one recipe."""

    name: str
    title: str
    plc_number: int | None
    """None where nothing good of it is known."""
    in_force: int | None
    """The approved revision; None where there is none."""
    file_state: Literal["approved", "draft", "broken", "missing"]
    """Its file, compared with that revision."""
    sha256: str
    """Of the file's values, to base a change on; empty where the file is broken or missing."""
    waiting: int | None
    """The revision that waits for approval."""
    waiting_author: str
    waiting_reason: str
    note: Message | None
    """Information, or an action for a person."""


class Recipes(ChannelMessage):
    """All recipes, by name."""

    rows: tuple[RecipeRow, ...]
    problems: tuple[Message, ...]
    """Problems of the folder's files."""
    editable: bool
    """Whether the folder is the site's; the shipped one belongs to the software."""
    folder: str
    """Their folder."""
    own_folder: str
    """A possible folder for a site's own."""


class GetRecipe(ChannelMessage):
    """Query one recipe's file, or one of its revisions."""

    purpose: ClassVar[str] = "for a recipe"
    name: Name
    revision: Revision | None = None
    """None for the file."""


class RecipeView(ChannelMessage):
    """A recipe's text and values."""

    row: RecipeRow
    text: str
    values: dict[str, Any]


class GetRecipeHistory(ChannelMessage):
    """Query a recipe's revisions, the newest first."""

    purpose: ClassVar[str] = "for a recipe's history"
    name: Name
    below: int | None = Field(default=None, ge=1)
    """Of the page before; None for the first."""


class Change(ChannelMessage):
    """One value that differs; both as JSON."""

    path: str
    old: str
    new: str


class RevisionView(ChannelMessage):
    """One revision, with the differences from the one before it."""

    revision: int
    status: Literal["draft", "approved", "retired"]
    origin: Literal["submitted", "shipped", "adopted"]
    sha256: str
    author: str
    reason: str
    created_utc_ms: int
    approver: str
    approval_reason: str
    approved_utc_ms: int | None
    retired_by: str
    retired_reason: str
    retired_utc_ms: int | None
    changes: tuple[Change, ...]


class RecipeHistory(ChannelMessage):
    """Newest first."""

    revisions: tuple[RevisionView, ...]
    below: int | None


class CompareRecipe(ChannelMessage):
    """Query every value that differs between two forms of a recipe."""

    purpose: ClassVar[str] = "for a recipe's differences"
    name: Name
    old: Revision | None = None
    """A revision; None for the approved one."""
    new: Revision | None = None
    """A revision; None for the file."""


class Changes(ChannelMessage):
    """In the order of the file."""

    changes: tuple[Change, ...]


class SaveDraft(ChannelMessage):
    """Change values in a recipe's file, with its comments, and record it as a draft. Answered with `RecipeRow`.

    Refused as a whole if the recipe would be invalid, or has changed since the author read it.
    """

    purpose: ClassVar[str] = "to save a draft"
    name: Name
    values: dict[Annotated[str, Field(max_length=100)], Scalar | list[float]] = Field(min_length=1, max_length=200)
    """New values by their dotted paths, as `damage.area[0].area_mm2`."""
    base: str = Field(pattern=r"^[0-9a-f]{64}$")
    """The version that the author read."""
    reason: Why
    actor: Actor


class SubmitRecipe(ChannelMessage):
    """Record a recipe's file as it is as a draft. Answered with `RecipeRow`."""

    purpose: ClassVar[str] = "to submit a recipe"
    name: Name
    reason: Why
    actor: Actor


class ApproveRecipe(ChannelMessage):
    """Put a draft in force for the next lot; its author cannot. Answered with `RecipeRow`."""

    purpose: ClassVar[str] = "to approve a recipe"
    name: Name
    revision: Revision
    reason: Why
    actor: Actor


class RejectRecipe(ChannelMessage):
    """Retire a draft: it is not put in force. Answered with `RecipeRow`."""

    purpose: ClassVar[str] = "to reject a draft"
    name: Name
    revision: Revision
    reason: Why
    actor: Actor


class RevertRecipe(ChannelMessage):
    """Put a revision's text back into the recipe's file. Answered with `RecipeRow`."""

    purpose: ClassVar[str] = "to put a recipe back"
    name: Name
    revision: Revision | None = None
    """None for the approved one."""
    reason: Why
    actor: Actor


class ExportRecipe(ChannelMessage):
    """Query a recipe's file with a first line that names it. Answered with `RecipeText`."""

    purpose: ClassVar[str] = "to export a recipe"
    name: Name
    revision: Revision | None = None


class RecipeText(ChannelMessage):
    """A recipe's YAML."""

    text: str


class ImportRecipe(ChannelMessage):
    """Replace a recipe's file by a whole recipe. Answered with `RecipeRow`."""

    purpose: ClassVar[str] = "to import a recipe"
    text: str = Field(min_length=1, max_length=LARGEST_TEXT)
    base: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    """The base revision; empty for the one that the text names."""
    reason: Why
    actor: Actor


class GetPastCurves(ChannelMessage):
    """Query the latest judged curves of a recipe's fruit, for comparison with limits."""

    purpose: ClassVar[str] = "for past curves"
    name: Name
    limit: int = Field(default=60, ge=1, le=MOST_CURVES)


class PastCurve(ChannelMessage):
    """One fruit's curve."""

    sequence: int
    outcome: str
    closings_mm: tuple[float, ...]
    areas_mm2: tuple[float, ...]
    growth_mm2_per_mm: float | None
    """The steepest, as the judge reckons it; None with too few points."""
    onset_mm: float | None
    """The fruit's width."""
    confidence: float | None
    """Of the last point that the judge needs."""


class PastCurves(ChannelMessage):
    """Newest first."""

    curves: tuple[PastCurve, ...]


class StartWhatIf(ChannelMessage):
    """Judge the last inspections again by the recipe's file as it is, as a job."""

    purpose: ClassVar[str] = "what a draft would have done"
    name: Name
    lot: Text = ""
    """Only of this lot; all where empty."""
    last: int = Field(default=500, ge=1, le=100_000)
    actor: Actor
