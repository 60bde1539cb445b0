"""Calibration rig of the running station: its gripper, its camera, and its arm if there is one."""

from collections.abc import Awaitable, Callable
from typing import NamedTuple

from station.calibration.rig import Place
from station.messages.message import Message
from station.press.rig import GripError, Position
from station.runtime.devices.rig import FRAME_DEADLINE_S, Cell, DeviceRig
from station.settings.arm import PoseName
from station.settings.recipe_model import Recipe

WhyRefused = Callable[[], Message | None]
"""Returns why something may not be moved now; None where it may."""


class Refusals(NamedTuple):
    """Refusals of the rig's motions."""

    motion: WhyRefused
    """Of every motion but an opening of the jaws."""
    opening: WhyRefused
    """Of an opening, which releases the ball also where nothing else may move."""


_NONE = Refusals(lambda: None, lambda: None)


class CalibrationRig(DeviceRig):
    """Rig for the procedures of `station.calibration`; the arm moves only between the nest and home.

    Args:
        lay: has the ball laid at a place; returns once it is there.
        activate: activates the gripper, only where that is safe: the ball may be between its jaws.
        patience: factor on the longest wait for a frame.
    """

    def __init__(
        self,
        cell: Cell,
        recipe: Recipe,
        lay: Callable[[Place], Awaitable[None]],
        activate: Callable[[], Awaitable[None]],
        patience: float = 1.0,
        refusals: Refusals = _NONE,
    ) -> None:
        super().__init__(cell, recipe, FRAME_DEADLINE_S * patience)
        self._lay, self._activate, self._refusals = lay, activate, refusals

    async def make_ready(self) -> None:
        """Activate the gripper, unless it is refused."""
        _require_none(self._refusals.motion)
        await self._activate()

    async def go(self, *poses: PoseName) -> None:
        """Bring the arm to one pose after the other, each unless it is refused."""
        for pose in poses:
            _require_none(self._refusals.motion)
            await super().go(pose)

    async def open(self, width_mm: float | None = None) -> Position:
        """Open fast, unless it is refused."""
        _require_none(self._refusals.opening)
        return await super().open(width_mm)

    async def close_to(self, width_mm: float) -> Position:
        """Move the fingers, unless it is refused."""
        _require_none(self._refusals.motion)
        return await super().close_to(width_mm)

    async def release(self, failed: Message | None = None) -> None:
        """Open, then leave, each unless it is refused."""
        _require_none(self._refusals.opening)
        await super().release(failed)

    async def lay(self, place: Place) -> None:
        """Have the ball laid at another place, relative to the first."""
        await self._lay(place)


def _require_none(refusal: WhyRefused) -> None:
    if why := refusal():
        raise GripError(why)
