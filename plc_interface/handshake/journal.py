"""Journal: state that survives the end of this process, so that the PLC never reads two outcomes of one inspection."""

from pydantic import BaseModel, ConfigDict, Field

from plc_interface.registers.map import BY_NAME
from station.channel.line import Outcome
from station.vocabulary import LONGEST_LOT

COMMAND_RESULT = BY_NAME["command_result"]
MOST_DISOWNED = 8
"""Maximum number of refused ids that the station may still begin; the oldest is dropped. An estimate."""


class _Persistent(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Running(_Persistent):
    """The inspection in progress."""

    sequence: int = Field(ge=1, lt=2**32)
    trigger_id: int = Field(ge=1, le=65_535)
    encoder: int = Field(ge=0, lt=2**32)
    lot: str = Field(max_length=LONGEST_LOT)
    fruit_length_mm_x10: int = Field(default=0, ge=0, le=65_535)
    size_class: int = Field(default=0, ge=0, le=65_535)
    within_s: float = Field(ge=0, allow_inf_nan=False)
    """From its acceptance: the interface's own deadline."""
    began_s: float = Field(allow_inf_nan=False)
    """On the monotonic clock."""
    began_utc_ms: int = Field(ge=0, lt=2**63)
    recipe_number: int = Field(ge=0, le=65_535)
    recipe_checksum: int = Field(ge=0, lt=2**32)
    simulated: bool


class Journal(_Persistent):
    """The persistent part of the state."""

    boots: int = Field(default=0, ge=0, lt=2**16)
    """Starts of the interface."""
    epoch: int = Field(default=0, ge=0, lt=2**32)
    """Resets of the counters, a start of the interface among them."""
    highest: int = Field(default=0, ge=0, lt=2**32)
    """The highest sequence of an accepted trigger, or of one of `hidden`: the next one is higher."""
    acknowledged: int = Field(default=0, ge=0, lt=2**32)
    """The PLC has taken everything up to here, or was never shown it."""
    plc_taken: int | None = Field(default=None, ge=0, lt=2**32)
    """What the PLC itself took last, where `acknowledged` has passed over `hidden` since; its register may still
    hold it.

    None where that is `acknowledged`, so that a version that does not know this field reads the journal all the same.
    """
    disbelieved: int = Field(default=0, ge=0, lt=2**32)
    """The last inspection that the PLC acknowledged before its outcome was shown: a start does not make that right."""
    accepted_id: int = Field(default=0, ge=0, le=65_535)
    """The last trigger id accepted."""
    lot: str = Field(default="", max_length=LONGEST_LOT)
    """The lot in force."""
    command_sequence: int | None = Field(default=None, ge=0, le=65_535)
    command_code: int | None = Field(default=None, ge=0, le=65_535)
    """Of the last command; None in the journal of a version that did not store it."""
    command_argument: int | None = Field(default=None, ge=0, le=65_535)
    command_result: int = Field(default=0, ge=0, le=65_535)
    """As in the register map."""
    asked_id: int | None = Field(default=None, ge=1, le=65_535)
    """The id of the trigger whose `Begin` is pending."""
    running: Running | None = None
    queue: tuple[Outcome, ...] = ()
    """Not acknowledged, in order of sequence."""
    verdicts: tuple[Outcome, ...] = ()
    """Final outcomes that the station has not noted yet: its own, and those that the interface gave."""
    disowned: tuple[int, ...] = ()
    """Ids of refused triggers that the station may have accepted, or may still accept, under sequences after `highest`.

    An id is removed when its sequence is hidden.
    """
    hidden: tuple[int, ...] = ()
    """Sequences of such triggers, once the station has reported them; never published."""
