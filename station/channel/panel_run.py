"""Messages of the operators' pages on the running station: its state, its latest fruit, operator commands.

Every command names its author and role, for the audit trail.
"""

from enum import StrEnum
from typing import Literal

from pydantic import Field, JsonValue

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor, ListedAlarm, RecoveryName
from station.messages.message import Message
from station.vocabulary import LONGEST_GROWER, OutcomeName, PackmlState


class OperatorCommandName(StrEnum):
    """Operator commands."""

    CHOOSE_RECIPE = "choose_recipe"
    """Argument: the recipe's PLC number. Takes effect between fruits."""
    START = "start"
    """Make a stopped station ready, and confirm that the cell is safe if a stop is latched: the PLC's reset."""
    STOP = "stop"
    """Take no more triggers; the fruit under way is inspected to its end."""
    CALL_OFF = "call_off"
    """End the running inspection with NO_RESULT. Argument: its number; refused where it is another's by now. Empty
    where it is not known."""
    RECOVER = "recover"
    """Argument: one of `RecoveryName`."""
    SET_MODE = "set_mode"
    """Argument: PackML mode, 1 production, 2 maintenance, 3 manual."""
    START_LOT = "start_lot"
    """Argument: its name, for fruit of which the PLC names no lot."""
    END_LOT = "end_lot"
    """The next fruit belongs to another lot, and gets the recipe that is then in force."""


class OperatorCommand(ChannelMessage):
    """Execute an operator command. Answered with `OperatorCommandView`.

    The answer holds the result, or for a command in progress its state so far; `PanelState` reports the rest. Not
    idempotent, except that a command in progress is not started twice.
    """

    person: Actor
    order: OperatorCommandName
    argument: str = Field(default="", max_length=64)
    grower: str = Field(default="", max_length=LONGEST_GROWER)
    """Of a lot that is started; may be empty."""


class OperatorCommandView(ChannelMessage):
    """An operator command, in progress or ended."""

    ticket: int
    """Rises by one with each order of this start of the station."""
    order: OperatorCommandName
    argument: str
    state: Literal["executing", "done", "failed"]
    why: Message | None
    """The error; else None."""
    who: str
    began_utc_ms: int
    ended_utc_ms: int | None


class PersonNoted(ChannelMessage):
    """An event of a person at the pages, for the audit trail. Answered with `line.Noted`."""

    person: Actor
    what: Literal[
        "logged_in",
        "log_in_refused",
        "logged_out",
        "idle",
        "added",
        "changed",
        "removed",
        "cleaning",
        "token_refused",
        "support_bundle",
        "configuration_saved",
    ]
    subject: str = Field(default="", max_length=200)
    old: dict[str, JsonValue] = Field(default_factory=dict)
    """What was changed, before and after it; mostly empty."""
    new: dict[str, JsonValue] = Field(default_factory=dict)


class GetPanelState(ChannelMessage):
    """Query the operator's summary. Answered with `PanelState`."""

    flooded_by: str | None = Field(default=None, max_length=64)
    """The address that floods the pages with connections; empty for none, null from who serves none."""


class RecipeNames(ChannelMessage):
    """Names of a recipe."""

    number: int
    name: str
    title: str
    revision: str


class RecipeSummary(RecipeNames):
    """Summary of a recipe in force."""

    values: str
    """The recipe as JSON, to be read as `station.settings.recipe_model.Recipe`."""


class DeviceView(ChannelMessage):
    """State of a device."""

    name: str
    fault: Message | None
    """None where it is healthy."""
    age_s: float | None
    """Since it was last found well; None where it never was."""


class FruitSummary(ChannelMessage):
    """One fruit's outcome in a list."""

    sequence: int
    outcome: OutcomeName
    reasons: tuple[str, ...]
    """As `station.vocabulary.Reason`; one of a later program may be unknown here."""
    ended_utc_ms: int
    duration_ms: int
    recipe: str
    lot: str
    area_mm2: float | None
    closing_mm: float | None
    areas_mm2: tuple[float, ...]
    """The curve's areas in the steps' order."""


class Counts(ChannelMessage):
    """Numbers of fruit by outcome."""

    passed: int = 0
    failed: int = 0
    unjudged: int = 0


class SetupView(ChannelMessage):
    """Facts of a first set-up, beside the rest of `PanelState`."""

    addresses: dict[str, str]
    """As configured, of each device that the station has and of `plc`."""
    poses_taught: bool
    """False while the poses at the nest are the simulated arm's and the arm is another."""
    joints_rad: tuple[float, ...] | None
    """The arm's present joint positions, to a ten-thousandth; None where it does not report them."""
    width_mm: float | None
    """As `Health` has it."""
    calibration: Message | None
    """The calibration in force; None for none."""
    zero_mm: float | None
    """The error of the jaws' zero that it measured."""
    has_reference: bool
    """An image of the untouched gel is stored."""
    ball_recipe: str
    """Name of the calibration ball's recipe, which is no fruit."""


class PanelState(ChannelMessage):
    """The operator's summary of the station."""

    boot: str
    """Another one after each start of the station."""
    utc_ms: int
    state: str
    """As `station.inspection.states.State` has it."""
    activity: Message
    """The present activity."""
    packml_state: PackmlState | None
    mode: int
    ready: bool
    why_not_ready: Message | None
    """With the remedy; None where ready."""
    busy: bool
    """A fruit is being inspected."""
    needs_person: bool
    """Nothing but a person's confirmation leads on."""
    stopping: bool
    """Stopped by a person: it accepts no trigger until it is started."""
    simulated: bool
    recipe: RecipeNames | None
    lot: str | None
    """None before the first fruit of one."""
    named_lot: str
    """The lot that was started at the panel; empty where none was."""
    plc_names_lots: bool
    plc_connected: bool
    plc_alive: bool
    line_trouble: Message | None
    check_due: Message | None
    """Why the check with the ball is required before any fruit; None if it is not."""
    alarms: tuple[ListedAlarm, ...]
    """Those that are not normal, most urgent first; those that are shelved are among them."""
    devices: tuple[DeviceView, ...]
    orders: tuple[OperatorCommandView, ...]
    """The last ones, newest first."""
    may: tuple[OperatorCommandName, ...]
    """Commands that would be accepted now."""
    recoveries: tuple[RecoveryName, ...]
    """Latched stops to recover from."""
    running_sequence: int | None
    """Of the fruit being inspected; None for none, and before its trigger is durable."""
    last_sequence: int | None
    """Of the last fruit with an outcome."""
    fruit_changes: int
    """Counts up with each new fruit, and with each whose outcome for the PLC became another one."""
    lot_counts: Counts
    """Of the lot under way; before its first fruit, of the one that was started at the panel."""
    deadline_s: float | None
    """The longest that an inspection may take by the active recipe and settings."""
    setup: SetupView


class GetRecent(ChannelMessage):
    """Query the latest fruit. Answered with `Recent`."""

    most: int = Field(default=20, ge=1, le=200)


class Recent(ChannelMessage):
    """Fruit, newest first."""

    fruit: tuple[FruitSummary, ...]


class GetFruit(ChannelMessage):
    """Query one of the latest fruit in full. Answered with `Fruit`; refused if it is not among the latest any more."""

    sequence: int = Field(ge=1, lt=2**32)


class CurvePointSummary(ChannelMessage):
    """A point of the area curve."""

    closing_mm: float
    area_mm2: float
    flagged: bool


class LimitView(ChannelMessage):
    """An area limit of the recipe."""

    closing_mm: float
    area_mm2: float
    least_area_mm2: float


class Fruit(ChannelMessage):
    """One fruit in full."""

    short: FruitSummary
    explanation: tuple[Message, ...]
    recipe_title: str
    revision: str
    onset_mm: float | None
    curve: tuple[CurvePointSummary, ...]
    limits: tuple[LimitView, ...]
    growth_mm2_per_mm: float
    """The largest of a good fruit."""
    deadline_s: float
    phases_s: dict[str, float]
    picture_step: int | None
    """Of which step there is a picture; None for none."""


class GetPicture(ChannelMessage):
    """Query a fruit's picture. Answered with `Picture`; refused if it is not stored any more."""

    sequence: int = Field(ge=1, lt=2**32)


class Picture(ChannelMessage):
    """An image with the contact's outline."""

    jpeg: str
    """Base64."""
    width_px: int
    height_px: int
    outline: tuple[tuple[int, int], ...]
    """Corners of the contact's outer edge, x and y; empty where no contact was found."""


class GetRecipes(ChannelMessage):
    """Query the recipes to select from. Answered with `Recipes`."""


class Recipes(ChannelMessage):
    """Recipes in force, by their number."""

    recipes: tuple[RecipeSummary, ...]
    active: RecipeSummary | None
    """The recipe of the next fruit; during a lot it may be an older revision."""
    problems: tuple[Message, ...]
    """Of the recipes' files."""
