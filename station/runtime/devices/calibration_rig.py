"""Calibration rig of the running station: its gripper, its camera, and its arm if there is one."""

from collections.abc import Awaitable, Callable, Sequence

from station.calibration.rig import Place, Pressed
from station.devices.camera.interface import Image
from station.devices.gripper.interface import ObjectState
from station.messages import grip as messages
from station.press.procedure import FRAME_DEADLINE_S, Cell, Grip, GripError
from station.settings.recipe import Recipe

_OPEN_WITHIN_MM = 2.0


class StationRig:
    """Rig for the procedures of `station.calibration`; the arm moves only between the nest and home.

    Args:
        cell: the opened devices.
        lay: has the ball laid at a place; returns once it is there.
        patience: factor on the longest wait for a frame.
    """

    def __init__(
        self, cell: Cell, recipe: Recipe, lay: Callable[[Place], Awaitable[None]], patience: float = 1.0
    ) -> None:
        self._cell, self._lay = cell, lay
        self._grip = Grip(cell, recipe, FRAME_DEADLINE_S * patience)

    async def untouched(self, number: int) -> Sequence[Image]:
        """Open the jaws, away from the nest if there is an arm, and take frames of the untouched gel.

        Raises:
            GripError: the jaws do not open.
            StationError: a device's fault.
        """
        gripper = self._cell.gripper
        await gripper.activate()
        opened = await gripper.open()
        stopped = opened.reading.object_state in {ObjectState.CONTACT_OPENING, ObjectState.CONTACT_CLOSING}
        if stopped or opened.width_mm < gripper.max_width_mm - _OPEN_WITHIN_MM:
            raise GripError(messages.JAWS_NOT_OPEN(width_mm=opened.width_mm, open_mm=gripper.max_width_mm))
        await self._grip.go("above_nest", "home")
        frames = [frame.image for frame in await self._grip.sound_frames(number)]
        await self._grip.go("above_nest", "nest")
        return frames

    async def press_to(self, width_mm: float) -> Pressed:
        """Move to a width and take the step's frames there.

        Raises:
            StationError: a device's fault.
        """
        step = await self._grip.step(0, width_mm)
        return Pressed(step.move.width_mm, [frame.image for frame in step.frames])

    async def lay(self, place: Place) -> None:
        """Have the ball laid at another place.

        Args:
            place: relative to the first place.
        """
        await self._lay(place)

    async def release(self) -> None:
        """Open the jaws and bring the arm home.

        Raises:
            GripError: one of the two failed.
        """
        if left := await self._grip.let_go():
            raise GripError(left)
