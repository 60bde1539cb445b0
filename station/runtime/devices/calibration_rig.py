"""Calibration rig of the running station: its gripper, its camera, and its arm if there is one."""

from collections.abc import Awaitable, Callable

from station.calibration.rig import Place
from station.runtime.devices.rig import FRAME_DEADLINE_S, Cell, DeviceRig
from station.settings.recipe import Recipe


class CalibrationRig(DeviceRig):
    """Rig for the procedures of `station.calibration`; the arm moves only between the nest and home.

    Args:
        lay: has the ball laid at a place; returns once it is there.
        patience: factor on the longest wait for a frame.
    """

    def __init__(
        self, cell: Cell, recipe: Recipe, lay: Callable[[Place], Awaitable[None]], patience: float = 1.0
    ) -> None:
        super().__init__(cell, recipe, FRAME_DEADLINE_S * patience)
        self._lay = lay

    async def lay(self, place: Place) -> None:
        """Have the ball laid at another place, relative to the first."""
        await self._lay(place)
