"""Names shared by the domain, the wire and the records: reasons, flags, refusals, PackML states."""

from enum import StrEnum
from typing import Literal

LONGEST_LOT = 32
"""Characters of a lot's name at most, as in the PLC's registers."""
LONGEST_GROWER = 64
"""Characters of a grower's name at most."""

OutcomeName = Literal["PASS", "FAIL", "NO_RESULT"]


class Reason(StrEnum):
    """Reason of an outcome that is not PASS. The order is the bits' order in the register map, bit 0 first."""

    AREA_OVER_LIMIT = "area_over_limit"
    GROWTH_OVER_LIMIT = "growth_over_limit"
    EARLY_STOP = "early_stop"
    NO_CONTACT = "no_contact"
    CONTACT_LOST = "contact_lost"
    AREA_NOT_RISING = "area_not_rising"
    CUT_BY_BORDER = "cut_by_border"
    SATURATED = "saturated"
    LOW_CONFIDENCE = "low_confidence"
    REFERENCE_BAD = "reference_bad"
    IMAGE_STALE = "image_stale"
    OUT_OF_RANGE = "out_of_range"
    """The fruit's width is not one of the recipe's."""
    LATE = "late"
    CALLED_OFF = "called_off"
    ARM_FAULT = "arm_fault"
    GRIPPER_FAULT = "gripper_fault"
    CAMERA_FAULT = "camera_fault"
    RECORDS_FAULT = "records_fault"
    STATION_LOST = "station_lost"
    """The station stopped answering, or was restarted, before the PLC had the outcome."""
    INTERNAL_FAULT = "internal_fault"
    NEAR_LIMIT = "near_limit"
    """The area or its growth is nearer to a limit than the measurement is certain."""
    SIZE_UNKNOWN = "size_unknown"
    """The recipe needs the fruit's size, and it is missing, impossible, or length and class contradict each other."""


class Flag(StrEnum):
    """Flag of a measured area: what a reader of it has to know."""

    NO_CONTACT = "no_contact"
    """Nothing touches the gel: the area is 0."""
    UNDECIDED = "undecided"
    """Something bends the gel, but no edge was found: the area is given as 0 and is unknown."""
    CUT_BY_BORDER = "cut_by_border"
    """The contact reaches the image's border: the area is a lower bound."""
    LOWER_BOUND = "lower_bound"
    """The edge was lost where the press so far had it: the contact is at least as large as this area."""
    SATURATED = "saturated"
    """Much of the contact is at the end of the grey scale: its edge may lie elsewhere."""
    LOW_CONFIDENCE = "low_confidence"
    """The confidence is below what the recipe requires."""
    REFERENCE_MISMATCH = "reference_mismatch"
    """The frame differs from its reference by more than contact and drift explain: take a new reference."""


class Refusal(StrEnum):
    """Reason of a refused trigger. The order is the codes' order in the register map, from 1."""

    NOT_ENABLED = "not_enabled"
    NOT_READY = "not_ready"
    BUSY = "busy"
    QUEUE_FULL = "queue_full"
    BAD_TRIGGER_ID = "bad_trigger_id"
    """The id is 0 or the one of the trigger before."""
    OFFLINE = "offline"
    STATION_LOST = "station_lost"
    RECIPE_CHANGING = "recipe_changing"
    NOT_WRITER = "not_writer"
    RECORDS_FULL = "records_full"
    """The station could not make the trigger durable."""


class PackmlState(StrEnum):
    """PackML states of ISA-TR88.00.02-2022, table 1, in the order of their numbers, from 1."""

    CLEARING = "clearing"
    STOPPED = "stopped"
    STARTING = "starting"
    IDLE = "idle"
    SUSPENDED = "suspended"
    EXECUTE = "execute"
    STOPPING = "stopping"
    ABORTING = "aborting"
    ABORTED = "aborted"
    HOLDING = "holding"
    HELD = "held"
    UNHOLDING = "unholding"
    SUSPENDING = "suspending"
    UNSUSPENDING = "unsuspending"
    RESETTING = "resetting"
    COMPLETING = "completing"
    COMPLETED = "completed"
