"""Messages from the PLC interface, which is the client, to the station, which answers.

The life of one trigger: `Begin` (durable when it is answered, so that an accepted trigger survives a crash of either
side) → `AwaitOutcome` → the PLC reads it → `Published` → the PLC acknowledges → `Acknowledged`. After a restart of
either side `Resume` returns the inspections that are accepted and not yet acknowledged.
"""

from enum import StrEnum
from typing import Literal

from pydantic import Field

from station.channel.messages import ChannelMessage
from station.messages.message import Message
from station.vocabulary import LONGEST_LOT, OutcomeName, PackmlState, Reason, Refusal


class CommandName(StrEnum):
    """Commands of the PLC, in the order of the codes in the register map, from 1."""

    CHANGE_RECIPE = "change_recipe"
    """Argument: the recipe's PLC number. Takes effect between fruits."""
    RESET = "reset"
    """Leave a stop whose cause is gone; never a person's at the panel, or a protective or emergency stop."""
    CALL_OFF = "call_off"
    """End the running inspection with NO_RESULT."""
    SET_MODE = "set_mode"
    """Argument: PackML mode, 1 production, 2 maintenance, 3 manual (ISA-TR88.00.02)."""
    CLEAR_ALARMS = "clear_alarms"
    """Acknowledge every alarm whose cause is gone."""


class Outcome(ChannelMessage):
    """The one outcome of an accepted trigger."""

    sequence: int = Field(ge=1, lt=2**32)
    """The inspection's number, from `BeginReply`; never used twice, also over restarts and new databases."""
    trigger_id: int = Field(ge=1, le=65_535)
    outcome: OutcomeName
    reasons: tuple[Reason, ...]
    """Empty only for PASS."""
    late: bool
    partial: bool
    """Ended before the recipe's last step."""
    simulated: bool
    """A twin's device took part."""
    area_mm2: float | None = Field(ge=0, allow_inf_nan=False)
    """The contact area that decided, or at the last closing with a result; None where nothing valid was measured."""
    area_px: int | None = Field(ge=0)
    closing_mm: float | None = Field(allow_inf_nan=False)
    """Closing at which that area was measured."""
    confidence: float | None = Field(ge=0, le=1)
    recipe_number: int = Field(ge=0, le=65_535)
    recipe_checksum: int = Field(ge=0, lt=2**32)
    """CRC-32 of the recipe's canonical JSON; 0 with number 0 where none was active."""
    began_utc_ms: int = Field(ge=0, lt=2**63)
    ended_utc_ms: int = Field(ge=0, lt=2**63)
    duration_ms: int = Field(ge=0, lt=2**32)
    """By the monotonic clock; 0 where it is not known, as of a station that was killed."""
    encoder: int = Field(ge=0, lt=2**32)
    """The line's encoder at the trigger, as given with `Begin`."""
    lot: str = Field(max_length=LONGEST_LOT)
    fruit_length_mm_x10: int = Field(default=0, ge=0, le=65_535)
    """The fruit's length as given with `Begin`; 0 where none was, and in outcomes of versions without it."""
    size_class: int = Field(default=0, ge=0, le=65_535)
    """Likewise."""


class Begin(ChannelMessage):
    """Inspect one fruit. Answered once the trigger is durable, before anything moves."""

    trigger_id: int = Field(ge=1, le=65_535)
    encoder: int = Field(ge=0, lt=2**32)
    lot: str = Field(max_length=LONGEST_LOT)
    fruit_length_mm_x10: int = Field(default=0, ge=0, le=65_535)
    """Length from stem to tip, tenths of a millimetre, as the line's grader measured it; 0 where none is given."""
    size_class: int = Field(default=0, ge=0, le=65_535)
    """The grader's; 0 where none is given."""


class BeginReply(ChannelMessage):
    """The trigger is accepted, or it is refused and nothing was started."""

    sequence: int | None = Field(default=None, ge=1, lt=2**32)
    """None where refused."""
    refusal: Refusal | None = None
    deadline_s: float = Field(default=0.0, ge=0, le=601, allow_inf_nan=False)
    """From now: the latest time at which the station itself ends this inspection, if need be with NO_RESULT: the
    inspection's own deadline, 600 s at most, and 1 s for the record."""


class AwaitOutcome(ChannelMessage):
    """Wait for the outcome of an accepted inspection."""

    sequence: int = Field(ge=1, lt=2**32)


class Published(ChannelMessage):
    """The PLC can read this outcome now. It is final, also against another one that the station holds."""

    outcome: Outcome


class Acknowledged(ChannelMessage):
    """The PLC has taken the outcomes up to this sequence."""

    sequence: int = Field(ge=0, lt=2**32)


class Resume(ChannelMessage):
    """Query the open inspections, after a start or a lost connection."""


class Open(ChannelMessage):
    """Inspections that are accepted and not acknowledged."""

    running: tuple[int, int] | None
    """Sequence and trigger id of the inspection under way."""
    outcomes: tuple[Outcome, ...]
    """Ended and not acknowledged, in order of sequence."""


class RegisterView(ChannelMessage):
    """One register of the PLC's by its name, as text."""

    name: str
    address: int
    value: str
    """With a code's name, or the names of the set bits, beside the number."""
    unit: str
    writable: bool
    """By the PLC."""
    meaning: str


class LineFault(ChannelMessage):
    """A fault of the PLC interface or of the CAN node."""

    part: Literal["handshake", "journal", "can", "reject"]
    """`reject` for a reject actuation that failed or was not ordered; `can` for the bus and its nodes."""
    what: Message


class Line(ChannelMessage):
    """State of the line at the interface, sent with every beat, for the station's alarms, metrics and pages."""

    plc_connected: bool
    plc_alive: bool
    """The PLC's heartbeat changes in time."""
    enabled: bool
    enable_withdrawn: bool = False
    """The PLC was enabled, its heartbeat or connection was lost, and it has not written enable 0 since."""
    waiting: int = Field(ge=0)
    """Outcomes that the PLC has not acknowledged."""
    counters: dict[str, int]
    """By name, as in the register map."""
    faults: tuple[LineFault, ...]
    registers: tuple[RegisterView, ...] = ()
    """In the order of their addresses; only if requested by the station, once."""


PACKML_STATE_NUMBERS = {state: number for number, state in enumerate(PackmlState, start=1)}


class StationState(ChannelMessage):
    """The station's state, the reply to `Line`."""

    boot: str = Field(min_length=1, max_length=64)
    """Another one after each start of the station."""
    healthy: bool
    """False while anything that inspecting needs makes no progress; the heartbeat to the PLC stops."""
    ready: bool
    """A trigger would be accepted now."""
    why_not_ready: Message | None
    """With the remedy; None where ready."""
    packml_state: PackmlState | None
    """None while it is unknown, as after a start; 0 in the register map."""
    mode: int = Field(ge=1, le=3)
    """PackML: 1 production, 2 maintenance, 3 manual."""
    recipe_number: int = Field(ge=0, le=65_535)
    """0 where no recipe is active."""
    recipe_checksum: int = Field(ge=0, lt=2**32)
    error_code: int = Field(ge=0, le=65_535)
    """The number of the active alarm of the highest priority, 0 for none."""
    alarms: int = Field(ge=0, lt=2**64)
    """Bit n is set while the alarm with number n + 1 is active."""
    simulated: bool
    registers_wanted: bool = False
    """A person wants to see the PLC's registers: the next beat is to bring them."""


class Command(ChannelMessage):
    """Execute a command of the PLC; answered when it is done."""

    command: CommandName
    argument: int = Field(ge=0, le=65_535)


class CommandDone(ChannelMessage):
    """Result of a command."""

    done: bool
    why: Message | None
    """None where done."""


class Noted(ChannelMessage):
    """The station has stored it durably."""
