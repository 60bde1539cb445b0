"""One grip without a judgement: reference, approach, width steps, and everything opened again."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Image
from station.errors import StationError
from station.service.grip import Cell, Grip, GripError, GripStep
from station.settings.recipe import Recipe
from station.vision.contact import Method

__all__ = ["BareGrip", "Cell", "GripStep"]

_HEALTH_LEASE_S = 2.0

MakeMethod = Callable[[Sequence[Image]], Method]


class BareGrip:
    """A grip by a recipe's width steps.

    Args:
        cell: the devices, opened; nothing may be between the fingers when a grip begins.
        recipe: width steps, speed, force, settle time and frames.
        make_method: makes the measurement that finds the onset, for reference frames.
        on_references: gets the reference frames, taken with nothing touching the gel.
        on_step: gets each step as it is reached.
    """

    def __init__(
        self,
        cell: Cell,
        recipe: Recipe,
        make_method: MakeMethod,
        on_references: Callable[[Sequence[Image]], None],
        on_step: Callable[[GripStep], Awaitable[None]],
    ) -> None:
        self._cell, self._recipe, self._make_method = cell, recipe, make_method
        self._on_references, self._on_step = on_references, on_step
        self._grip = Grip(cell, recipe)

    async def run(self) -> None:
        """Grip once, let go, and go home. Not idempotent: each call grips.

        Raises:
            GripError: no sound frame came, nothing was touched down to the recipe's smallest width, or the gripper
                or the arm could not be brought back.
            StationError: a device's own fault; by then the gripper is open and the arm home where they could be.
        """
        async with kept_healthy(self._cell.arm):
            try:
                await self._press()
            except (StationError, asyncio.CancelledError) as error:
                what = str(error).rstrip(".") or "the grip was called off"
                if left := await self._grip.let_go():
                    raise GripError(what + f". {left}".removesuffix(f": {error}")) from error
                raise
            if left := await self._grip.let_go():
                raise GripError(left)

    async def _press(self) -> None:
        await self._cell.gripper.activate()
        await self._cell.gripper.open()
        await self._grip.go("home", "above_nest")
        references = [frame.image for frame in await self._grip.sound_frames(self._recipe.imaging.reference_frames)]
        self._on_references(references)
        await self._grip.go("nest")
        plan = self._recipe.steps
        if plan.start_width_mm is not None:
            start = await self._grip.step(0, plan.start_width_mm)
        else:
            method = await asyncio.to_thread(self._make_method, references)

            async def touches(step: GripStep) -> bool:
                return (await asyncio.to_thread(method.measure, step.image)).is_firm

            before, start = await self._grip.approach(touches)
            if before is not None:
                await self._on_step(before)
        await self._on_step(start)
        for number in range(1, plan.number + 1):
            await self._on_step(await self._grip.step(number, start.move.width_mm - number * plan.step_mm))


@contextlib.asynccontextmanager
async def kept_healthy(arm: Arm | None) -> AsyncIterator[None]:
    """Renew the arm's lease for as long as this program's loop runs: if it hangs, the controller stops the arm.

    Args:
        arm: None on a bench, where there is nothing to renew.
    """

    async def renew(arm: Arm) -> None:
        while True:
            arm.renew_health(_HEALTH_LEASE_S)
            await asyncio.sleep(_HEALTH_LEASE_S / 4)

    if arm is None:
        yield
        return
    renewing = asyncio.create_task(renew(arm), name="arm's health")
    try:
        yield
    finally:
        renewing.cancel()
        await asyncio.gather(renewing, return_exceptions=True)
