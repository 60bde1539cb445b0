"""One grip without a judgement: reference, approach, width steps, and everything opened again."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass

import numpy as np

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Camera, Frame, Image
from station.devices.gripper.interface import Gripper, MoveResult
from station.errors import StationError
from station.settings.arm import PoseName
from station.settings.recipe import Recipe
from station.vision.contact import Method

FRAME_DEADLINE_S = 1.0
_HEALTH_LEASE_S = 2.0
_MOST_FAULTY_FRAMES = 10

MakeMethod = Callable[[Sequence[Image]], Method]


class GripError(StationError):
    """The grip could not be carried through; the message says at which step and why."""


@dataclass(frozen=True, slots=True)
class GripStep:
    """One width step of a grip."""

    number: int
    """0 at the start, the onset or the recipe's start width; negative for the approach's last image before it."""
    move: MoveResult
    image: Image
    """The mean of the recipe's frames, shape (height, width, 3), dtype uint8, BGR."""
    last_frame: Frame
    """The newest of them."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The devices of one station, ready to be used; no arm on a bench."""

    camera: Camera
    gripper: Gripper
    arm: Arm | None


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

    async def run(self) -> None:
        """Grip once, let go, and go home. Not idempotent: each call grips.

        Raises:
            GripError: no sound frame came, nothing was touched down to the recipe's smallest width, or the gripper
                or the arm could not be brought back.
            StationError: a device's own fault; by then the gripper is open and the arm home where they could be.
        """
        async with _kept_healthy(self._cell.arm):
            try:
                await self._grip()
            except (StationError, asyncio.CancelledError) as error:
                what = str(error).rstrip(".") or "the grip was called off"
                if left := await self._let_go():
                    raise GripError(what + f". {left}".removesuffix(f": {error}")) from error
                raise
            if left := await self._let_go():
                raise GripError(left)

    async def _grip(self) -> None:
        imaging = self._recipe.imaging
        await self._cell.gripper.activate()
        await self._cell.gripper.open()
        await self._go("home", "above_nest")
        references = [(await self._sound_frame()).image for _ in range(imaging.reference_frames)]
        self._on_references(references)
        await self._go("nest")
        plan = self._recipe.steps
        if plan.start_width_mm is not None:
            start = await self._step(0, plan.start_width_mm)
        else:
            before, start = await self._onset(references)
            if before is not None:
                await self._on_step(before)
        await self._on_step(start)
        for number in range(1, plan.number + 1):
            await self._on_step(await self._step(number, start.move.width_mm - number * plan.step_mm))

    async def _let_go(self) -> str | None:
        """Open, then leave: an arm that leaves with closed fingers would tear what they hold.

        Returns:
            What could not be done, in words.
        """
        try:
            await self._cell.gripper.open()
        except StationError as error:
            return f"The gripper could not be opened, and the arm stays where it is: {error}"
        try:
            await self._go("above_nest", "home")
        except StationError as error:
            return f"The gripper is open, and the arm stays where it is: {error}"
        return None

    async def _onset(self, references: Sequence[Image]) -> tuple[GripStep | None, GripStep]:
        """Close step by step until the gel is touched; give the last image before the contact and the first with it."""
        method = await asyncio.to_thread(self._make_method, references)
        expected, step_mm = self._recipe.expected_width, self._recipe.steps.step_mm
        width_mm = min(expected.largest_mm, self._cell.gripper.max_width_mm)
        before: GripStep | None = None
        while width_mm >= expected.smallest_mm - step_mm:
            step = await self._step(-1, width_mm)
            contact = await asyncio.to_thread(method.measure, step.image)
            if contact.found:
                return before, GripStep(0, step.move, step.image, step.last_frame)
            before = step
            width_mm -= step_mm
        raise GripError(
            f"nothing was touched from {expected.largest_mm:g} down to {expected.smallest_mm:g} mm: is a "
            f"{self._recipe.name} in the nest, and is the arm there? The gripper is open again"
        )

    async def _step(self, number: int, width_mm: float) -> GripStep:
        grip, imaging = self._recipe.gripper, self._recipe.imaging
        move = await self._cell.gripper.move_to_width(max(0.0, width_mm), grip.speed_mm_s, grip.force_n)
        await asyncio.sleep(imaging.settle_s)
        frames = [await self._sound_frame() for _ in range(imaging.frames_per_step)]
        mean = np.mean([frame.image for frame in frames], axis=0)
        return GripStep(number, move, np.rint(mean).astype(np.uint8), frames[-1])

    async def _sound_frame(self) -> Frame:
        """A frame captured from now on with nothing wrong with it."""
        faults: set[str] = set()
        for _ in range(_MOST_FAULTY_FRAMES):
            frame = await self._cell.camera.frame(time.monotonic(), FRAME_DEADLINE_S)
            if not frame.faults:
                return frame
            faults |= frame.faults
        raise GripError(
            f"the camera gave {_MOST_FAULTY_FRAMES} bad frames in a row ({', '.join(sorted(faults))}); "
            "see `station devices check`"
        )

    async def _go(self, *poses: PoseName) -> None:
        if self._cell.arm is not None:
            for pose in poses:
                await self._cell.arm.move_to(pose)


@contextlib.asynccontextmanager
async def _kept_healthy(arm: Arm | None) -> AsyncIterator[None]:
    """Renew the arm's lease for as long as this program's loop runs: if it hangs, the controller stops the arm."""

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
