"""What the station asks of a gripper, and what it gets to know."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class ObjectState(StrEnum):
    """What the gripper feels between its fingers."""

    IDLE = "idle"
    """No motion is asked for, and without one the gripper does not look."""
    MOVING = "moving"
    CONTACT_OPENING = "contact_opening"
    """Stopped by something outside the fingers."""
    CONTACT_CLOSING = "contact_closing"
    """Stopped by something between the fingers at the force asked for. A soft fruit is often too soft for that."""
    AT_POSITION = "at_position"
    LOST = "lost"
    """What was held is no longer felt."""


@dataclass(frozen=True, slots=True)
class GripperReading:
    """One look at the gripper."""

    width_mm: float
    """Measured gap that is left for the fruit; negative where the fingers press on each other."""
    position_count: int
    echoed_count: int
    """The position request that the gripper has."""
    object_state: ObjectState
    active: bool
    """Activated and ready to move."""
    fault_code: int
    """0, or the gripper's own code."""
    current_a: float | None
    """Motor current; None where the wire does not carry it."""
    at_s: float
    """Monotonic time just before the gripper was asked."""

    def age_s(self, now_s: float) -> float:
        """How old the reading is, in seconds.

        Args:
            now_s: monotonic time, as of `time.monotonic()`.
        """
        return now_s - self.at_s


@dataclass(frozen=True, slots=True)
class MoveResult:
    """How a move ended."""

    requested_width_mm: float
    requested_count: int
    reading: GripperReading
    """The gripper at the end of the move."""

    @property
    def width_mm(self) -> float:
        """The measured width: what counts, since a millimetre is no whole number of counts."""
        return self.reading.width_mm


class Gripper(Protocol):
    """A two-finger gripper. Every verb ends, with a result or with a `GripperError`, within its settings' times."""

    @property
    def max_width_mm(self) -> float:
        """The widest gap for fruit that the fingers leave."""
        ...

    async def activate(self) -> GripperReading:
        """Make the gripper ready. Idempotent: one that is active does not move.

        Otherwise **the fingers travel their whole way**: nothing may be between them.
        """
        ...

    async def open(self, width_mm: float | None = None) -> MoveResult:
        """Open fast: fully, or to a width. Idempotent.

        Args:
            width_mm: gap between the finger surfaces; None for `max_width_mm`.
        """
        ...

    async def move_to_width(self, width_mm: float, speed_mm_s: float, force_N: float) -> MoveResult:
        """Move until the width is reached or something is felt. Idempotent.

        Args:
            width_mm: gap between the finger surfaces, 0 to `max_width_mm`.
            speed_mm_s: within what the gripper can do.
            force_N: where to stop on contact; no protection for a soft fruit, whose skin fails below 20 N.
        """
        ...

    async def stop(self) -> GripperReading:
        """Stop where the fingers are; moves under way or waiting end with `GripperStoppedError`. Idempotent."""
        ...

    async def read(self) -> GripperReading:
        """Ask the gripper, without moving it."""
        ...

    async def close(self) -> None:
        """Give the wire back, not the fingers. Idempotent; a later verb opens the wire again."""
        ...
