"""Calibration rig: the interface through which a procedure presses a ball."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from station.messages.message import Message
from station.press.rig import Rig


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


class BallRig(Rig, Protocol):
    """A press rig with a ball between its fingers."""

    async def lay(self, place: Place) -> None:
        """Have the ball laid at a place relative to its first, with the jaws open; returns once it is there."""
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
