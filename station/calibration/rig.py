"""Calibration rig: the interface through which a procedure presses a ball."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from station.messages.message import Message
from station.vision.contact import Image


class Place(NamedTuple):
    """Place of the ball on the gel, relative to its first place."""

    x_mm: float
    y_mm: float


@dataclass(frozen=True, slots=True)
class Unit:
    """Identity of the sensor."""

    serial: str
    name: str
    simulated: bool


@dataclass(frozen=True, slots=True, eq=False)
class Pressed:
    """Frames at one width."""

    width_mm: float
    """Measured."""
    frames: Sequence[Image]
    """Frames without faults, all captured after the fingers had come to rest."""


class Rig(Protocol):
    """Gripper and camera with a ball between them."""

    async def untouched(self, number: int) -> Sequence[Image]:
        """Open the jaws and take frames of the untouched gel."""
        ...

    async def press_to(self, width_mm: float) -> Pressed:
        """Move to a width, let the gel settle, take a step's frames."""
        ...

    async def lay(self, place: Place) -> None:
        """Have the ball laid at another place, with the jaws open; returns once it is there.

        Args:
            place: relative to the first place.
        """
        ...

    async def release(self) -> None:
        """Open the jaws in any case; raises the reason if they remain closed."""
        ...


class Progress(NamedTuple):
    """Progress of a procedure."""

    number: int
    """Of this stage, from 1."""
    of: int
    title: Message
    detail: Message | None


OnProgress = Callable[[Progress], None]
"""Called with every progress."""
