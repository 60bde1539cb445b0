"""Calibration rig of the running station: its gripper, its camera, and its arm if there is one."""

from collections.abc import Awaitable, Callable

from station.calibration.rig import Place
from station.messages.message import Message
from station.press.rig import GripError, Position
from station.runtime.devices.rig import FRAME_DEADLINE_S, Cell, DeviceRig
from station.settings.arm import PoseName
from station.settings.recipe_model import Recipe

WhyRefused = Callable[[], Message | None]
"""Returns why something may not be moved now; None where it may."""


class CalibrationRig(DeviceRig):
    """Rig for the procedures of `station.calibration`; the arm moves only between the nest and home.

    Args:
        lay: has the ball laid at a place; returns once it is there.
        patience: factor on the longest wait for a frame.
        refusal: of every motion but an opening of the jaws.
        opening_refusal: of an opening, which releases the ball also where nothing else may move.
    """

    def __init__(
        self,
        cell: Cell,
        recipe: Recipe,
        lay: Callable[[Place], Awaitable[None]],
        patience: float = 1.0,
        refusal: WhyRefused = lambda: None,
        opening_refusal: WhyRefused = lambda: None,
    ) -> None:
        super().__init__(cell, recipe, FRAME_DEADLINE_S * patience)
        self._lay, self._refusal, self._opening_refusal = lay, refusal, opening_refusal

    async def make_ready(self) -> None:
        """Activate the gripper, unless it is refused."""
        _require_none(self._refusal)
        await super().make_ready()

    async def go(self, *poses: PoseName) -> None:
        """Bring the arm to one pose after the other, each unless it is refused."""
        for pose in poses:
            _require_none(self._refusal)
            await super().go(pose)

    async def open(self, width_mm: float | None = None) -> Position:
        """Open fast, unless it is refused."""
        _require_none(self._opening_refusal)
        return await super().open(width_mm)

    async def close_to(self, width_mm: float) -> Position:
        """Move the fingers, unless it is refused."""
        _require_none(self._refusal)
        return await super().close_to(width_mm)

    async def release(self, failed: Message | None = None) -> None:
        """Open, then leave, each unless it is refused."""
        _require_none(self._opening_refusal)
        await super().release(failed)

    async def lay(self, place: Place) -> None:
        """Have the ball laid at another place, relative to the first."""
        await self._lay(place)


def _require_none(refusal: WhyRefused) -> None:
    if why := refusal():
        raise GripError(why)
