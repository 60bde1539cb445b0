"""Gripper link: the wire's interface for the driver, with the gripper's status and four commands."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from station.messages.message import Message


class State(IntEnum):
    """gSTA."""

    RESET = 0
    ACTIVATING = 1
    ACTIVE = 3


@dataclass(frozen=True, slots=True)
class Status:
    """The gripper's registers as read."""

    state: int
    """gSTA."""
    go_to: bool
    """gGTO: a motion is requested; if not, gOBJ means nothing."""
    object_: int
    """gOBJ."""
    fault: int
    """gFLT."""
    echo: int
    """gPR."""
    position: int
    """gPO."""
    current_a: float | None
    """gCU, None if the wire does not carry it."""


class Link(Protocol):
    """One wire to one gripper.

    Connects when first used and again after `close` or a failure; connecting never moves the fingers. Any failure
    closes the connection, so that a late answer can never be taken for the next one.
    Each call is one whole exchange, raises a `GripperError`, and ends within the answer time-out. One that is cancelled
    ends with the request under way, so that a command after it is carried out after it.
    """

    @property
    def place(self) -> Message:
        """Describe the device at the other end and its address."""
        ...

    async def status(self) -> Status:
        """Read the registers."""
        ...

    async def reset(self) -> None:
        """Deactivate: clears latched faults, the fingers do not move."""
        ...

    async def begin_activation(self) -> None:
        """Raise the activation bit: the fingers travel. An automatic release has to open them, not close."""
        ...

    async def go_to(self, position: int, speed: int, force: int) -> None:
        """Move; only for an active gripper. Position, speed and force are 0 to 255."""
        ...

    async def halt(self) -> None:
        """Stop moving, and stay active if active."""
        ...

    async def close(self) -> None:
        """Close the connection."""
        ...
