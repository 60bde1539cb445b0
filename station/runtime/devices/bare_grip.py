"""Grip without a judgement: reference, approach, width steps, release."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Image
from station.errors import StationError
from station.messages import grip as messages
from station.press.procedure import Cell, Grip, GripError, GripStep
from station.settings.recipe import Recipe
from station.vision.contact import Method

__all__ = ["BareGrip", "Cell", "GripStep"]

_HEALTH_LEASE_S = 2.0

MakeMethod = Callable[[Sequence[Image]], Method]


class BareGrip:
    """One grip by a recipe's width steps.

    Args:
        cell: the opened devices; nothing may be between the fingers when a grip begins.
        make_method: makes the measurement method that finds the contact onset, from reference frames.
        on_references: receives the reference frames, taken with nothing touching the gel.
        on_step: receives each step.
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
        """Grip once, release, and move home. Not idempotent: each call grips.

        Raises:
            GripError: no sound frame came, nothing was touched down to the recipe's smallest width, or the gripper
                or the arm did not return.
            StationError: a device's fault; the gripper is open and the arm home by then, if they could move.
        """
        async with renewed_lease(self._cell.arm):
            try:
                await self._press()
            except (StationError, asyncio.CancelledError) as error:
                failed = error.message if isinstance(error, StationError) else messages.CALLED_OFF()
                if left := await self._grip.let_go(failed):
                    raise GripError(left) from error
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
async def renewed_lease(arm: Arm | None) -> AsyncIterator[None]:
    """Renew the arm's lease while this program's loop runs: if the loop hangs, the controller stops the arm.

    Args:
        arm: None without an arm: nothing is renewed.
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
