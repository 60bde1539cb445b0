"""Press rig: fingers and a tactile camera, as the press procedure uses them.

Every verb ends, with a result or a `StationError`; how long it may take is the rig's own matter.
"""

import asyncio
from dataclasses import dataclass
from typing import Protocol

from station.errors import StationError
from station.messages.message import Message
from station.vision.contact import Contact, Image
from station.vision.step import mean_image


class GripError(StationError):
    """The press could not be carried through; the message says at which step and why."""


class Frame(Protocol):
    """One image with its number and its time."""

    @property
    def image(self) -> Image:
        """Shape (height, width, 3), dtype uint8, BGR."""
        ...

    @property
    def sequence(self) -> int:
        """The camera's number of the frame."""
        ...

    @property
    def captured_s(self) -> float:
        """Monotonic time of capture."""
        ...


@dataclass(frozen=True, slots=True)
class Position:
    """The fingers at one time, or at the end of a move."""

    width_mm: float
    """Measured; a millimetre is no whole number of the gripper's counts."""
    at_s: float = 0.0
    """Monotonic time of the reading; 0 where a rig has no clock."""
    held: bool = False
    """Stopped by something between the fingers, at the force limit."""
    blocked: bool = False
    """Stopped by something on the way, whether closing or opening."""
    requested_mm: float | None = None
    """What the move was to reach; None outside a move."""
    state: str = ""
    """The gripper's own word for `held` and `blocked`."""
    current_a: float | None = None
    """Of the motor; None where it is not known."""


@dataclass(frozen=True, slots=True)
class Step:
    """One width step of a press."""

    number: int
    """0 at the start, the onset or the recipe's start width; negative for the approach's images before it."""
    move: Position
    frames: tuple[Frame, ...]
    """All captured after the move's end, in order; none has a fault."""

    @property
    def images(self) -> list[Image]:
        """The frames' images, in order."""
        return [frame.image for frame in self.frames]

    @property
    def image(self) -> Image:
        """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
        return mean_image(self.images)

    @property
    def last_frame(self) -> Frame:
        """The newest frame."""
        return self.frames[-1]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredStep:
    """One width step as it was measured."""

    step: Step
    image: Image
    """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
    contact: Contact


class Rig(Protocol):
    """Fingers and camera of one press. Widths are gaps between the fingers, mm."""

    @property
    def widest_mm(self) -> float:
        """The width of the open fingers."""
        ...

    @property
    def finest_step_mm(self) -> float:
        """The smallest way that the fingers surely go: the onset is searched in such steps."""
        ...

    async def make_ready(self) -> None:
        """Make the fingers able to move; those that are do not move. Nothing may be between them."""
        ...

    async def leave_nest(self) -> None:
        """Move the fingers away from the fruit's place; without an arm nothing moves."""
        ...

    async def enter_nest(self) -> None:
        """Move the fingers to the fruit's place; without an arm nothing moves."""
        ...

    async def open(self, width_mm: float | None = None) -> Position:
        """Open to a width; None for fully. Idempotent."""
        ...

    async def close_to(self, width_mm: float) -> Position:
        """Move to a width at the recipe's speed, up to its force; less than 0 is 0. Idempotent."""
        ...

    async def settle(self) -> None:
        """Let fruit and gel come to rest: every step waits as long, because fruit creeps."""
        ...

    async def frames(self, number: int) -> tuple[Frame, ...]:
        """Take frames captured from now on with nothing wrong with them."""
        ...

    async def release(self, failed: Message | None = None) -> None:
        """Open, then leave: an arm that leaves with closed fingers would tear what they hold. Idempotent.

        Args:
            failed: what failed before; part of the error's message.

        Raises:
            GripError: the fingers did not open, or they did not leave.
        """
        ...


class MovingRig(Rig, Protocol):
    """A rig that also sees and stops its fingers while they move."""

    async def read(self) -> Position:
        """Read the fingers, without moving them."""
        ...

    async def frame(self, newer_than_s: float) -> Frame:
        """Take the first frame without a fault captured after a monotonic time."""
        ...

    async def stop(self, moving: asyncio.Future[Position]) -> None:
        """Stop the fingers where they are, and wait until the move under way has ended."""
        ...
