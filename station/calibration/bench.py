"""What a ball is pressed with, and who lays it in: asked for by a procedure, given by whoever runs it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from station.vision.contact import Image


class Place(NamedTuple):
    """Where the ball lies on the gel, from its first place."""

    x_mm: float
    y_mm: float


@dataclass(frozen=True, slots=True)
class Unit:
    """The sensor that is looked at."""

    serial: str
    name: str
    simulated: bool


@dataclass(frozen=True, slots=True, eq=False)
class Pressed:
    """The fingers at a width."""

    width_mm: float
    """Measured."""
    frames: Sequence[Image]
    """Sound ones, all captured after the fingers had come to rest."""


class Bench(Protocol):
    """Gripper and camera with a ball between them."""

    async def untouched(self, number: int) -> Sequence[Image]:
        """Open the jaws and take frames of the untouched gel.

        Args:
            number: how many.
        """
        ...

    async def press_to(self, width_mm: float) -> Pressed:
        """Go to a width, let the gel come to rest, take a step's frames.

        Args:
            width_mm: the width to ask for.
        """
        ...

    async def lay(self, place: Place) -> None:
        """With the jaws open, have the ball laid at another place; returns once it lies there.

        Args:
            place: where, from the first one.
        """
        ...

    async def release(self) -> None:
        """Open the jaws, whatever happened; raises what keeps them closed."""
        ...


class Progress(NamedTuple):
    """What a procedure is doing."""

    number: int
    """Of this stage, from 1."""
    of: int
    title: str
    detail: str


Tell = Callable[[Progress], None]
"""Gets every progress."""
