"""Gripper interface of the station."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from station.devices.gripper.errors import NEEDS_ACTIVATION


class ObjectState(StrEnum):
    """Object detection between the fingers."""

    IDLE = "idle"
    """No motion is requested, and without one the gripper detects nothing."""
    MOVING = "moving"
    CONTACT_OPENING = "contact_opening"
    """Stopped by something outside the fingers."""
    CONTACT_CLOSING = "contact_closing"
    """Stopped by something between the fingers at the requested force. A soft fruit is often too soft for that."""
    AT_POSITION = "at_position"
    LOST = "lost"
    """The held object is no longer detected."""


@dataclass(frozen=True, slots=True)
class GripperReading:
    """Reading of the gripper."""

    width_mm: float
    """Measured gap for the fruit; negative if the fingers press on each other."""
    position_count: int
    object_state: ObjectState
    active: bool
    """Activated and ready to move."""
    fault_code: int
    """0, or the gripper's own code."""
    current_a: float | None
    """Motor current; None if the wire does not carry it."""
    at_s: float
    """Monotonic time just before the request."""

    def age_s(self, now_s: float) -> float:
        """Return the age of the reading, in seconds, at a time of `time.monotonic()`."""
        return now_s - self.at_s

    @property
    def needs_activation(self) -> bool:
        """Return whether it moves again only after an activation, in which its fingers travel their whole way."""
        return not self.active or self.fault_code in NEEDS_ACTIVATION


@dataclass(frozen=True, slots=True)
class MoveResult:
    """Result of a move."""

    requested_width_mm: float
    reading: GripperReading
    """The gripper at the end of the move."""

    @property
    def width_mm(self) -> float:
        """Return the measured width; it is the valid one, because a millimetre is no whole number of counts."""
        return self.reading.width_mm


class Gripper(Protocol):
    """A two-finger gripper. Every method ends, with a result or with a `GripperError`, within its settings' times."""

    @property
    def max_width_mm(self) -> float:
        """Return the widest gap for fruit."""
        ...

    @property
    def known_width_mm(self) -> float | None:
        """Return the gap at which the fingers were last read at rest; None if they may be elsewhere.

        A gripper without its activation reports positions that mean nothing, after a loss of power even an open one.
        """
        ...

    async def activate(self) -> GripperReading:
        """Make the gripper ready. Idempotent: one that is active does not move.

        Otherwise **the fingers travel their whole way**: nothing may be between them.
        """
        ...

    async def open(self, width_mm: float | None = None) -> MoveResult:
        """Open fast to a gap between the finger surfaces; None for `max_width_mm`. Idempotent."""
        ...

    async def move_to_width(self, width_mm: float, speed_mm_s: float, force_N: float) -> MoveResult:
        """Move until the width is reached or an object is detected. Idempotent.

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
        """Read the gripper, without moving it."""
        ...

    async def close(self) -> None:
        """Close the wire, not the fingers. Idempotent; a later call opens the wire again."""
        ...
