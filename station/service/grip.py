"""The parts of a grip: sound frames, width steps, the approach, letting go. Why it grips is not known here."""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Collection
from dataclasses import dataclass

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Camera, Frame, FrameFault, Image
from station.devices.gripper.errors import GripperStoppedError
from station.devices.gripper.interface import Gripper, MoveResult, ObjectState
from station.errors import StationError
from station.inspection.second_press import SEARCH_AGAIN_STEPS
from station.settings.arm import PoseName
from station.settings.recipe import Recipe
from station.vision.step import mean_image

FRAME_DEADLINE_S = 1.0
FINEST_STEP_MM = 0.4
"""A count of the gripper."""
_MOST_FAULTY_FRAMES = 10


class GripError(StationError):
    """The grip could not be carried through; the message says at which step and why."""


class FramesError(GripError):
    """The camera gives frames, and none that can be measured."""

    def __init__(self, text: str, faults: Collection[FrameFault]) -> None:
        super().__init__(text)
        self.faults = frozenset(faults)
        """What was wrong with them."""


class NothingTouchedError(GripError):
    """The fingers closed down to the recipe's smallest width and nothing was there."""


class UnseenContactError(GripError):
    """The gripper holds something that the sensor does not see."""


@dataclass(frozen=True, slots=True)
class GripStep:
    """One width step of a grip."""

    number: int
    """0 at the start, the onset or the recipe's start width; negative for the approach's last image before it."""
    move: MoveResult
    frames: tuple[Frame, ...]
    """All captured after the move's end, in order; none has a fault."""

    @property
    def image(self) -> Image:
        """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
        return mean_image([frame.image for frame in self.frames])

    @property
    def last_frame(self) -> Frame:
        """The newest frame."""
        return self.frames[-1]


@dataclass(frozen=True, slots=True)
class Cell:
    """The devices of one station, ready to be used; no arm on a bench."""

    camera: Camera
    gripper: Gripper
    arm: Arm | None


Touches = Callable[[GripStep], Awaitable[bool]]
"""Says whether the gel is touched in a step's frames."""


class Grip:
    """The moves of one grip by a recipe.

    Args:
        cell: the devices, opened.
        recipe: width steps, speed, force, settle time and frames.
        frame_deadline_s: longest wait for one frame.
        on_frame: gets every frame as it comes, also those with faults.
    """

    def __init__(
        self,
        cell: Cell,
        recipe: Recipe,
        frame_deadline_s: float = FRAME_DEADLINE_S,
        on_frame: Callable[[Frame], None] = lambda _frame: None,
    ) -> None:
        self._cell, self._recipe, self._frame_deadline_s = cell, recipe, frame_deadline_s
        self._on_frame = on_frame

    async def go(self, *poses: PoseName) -> None:
        """Bring the arm to one pose after the other; without an arm nothing moves.

        Raises:
            ArmFault: the arm did not get there.
        """
        if self._cell.arm is not None:
            for pose in poses:
                await self._cell.arm.move_to(pose)

    async def sound_frames(self, number: int) -> tuple[Frame, ...]:
        """Frames captured from now on with nothing wrong with them.

        Raises:
            FramesError: too many in a row had a fault.
            NoFrameError: none came in time.
        """
        frames: list[Frame] = []
        newer_than_s = time.monotonic()
        while len(frames) < number:
            frames.append(await self._sound_frame(newer_than_s))
            newer_than_s = frames[-1].captured_s
        return tuple(frames)

    async def step(self, number: int, width_mm: float) -> GripStep:
        """Go to a width, let fruit and gel settle, and take the recipe's frames.

        Args:
            number: what the step is called.
            width_mm: the width to ask for; less than 0 is 0.
        """
        move = await self.close_to(width_mm)
        await asyncio.sleep(self._recipe.imaging.settle_s)
        return GripStep(number, move, await self.sound_frames(self._recipe.imaging.frames_per_step))

    async def close_to(self, width_mm: float) -> MoveResult:
        """Move the fingers at the recipe's speed and force.

        Args:
            width_mm: the width to ask for; less than 0 is 0.
        """
        grip = self._recipe.gripper
        return await self._cell.gripper.move_to_width(max(0.0, width_mm), grip.speed_mm_s, grip.force_n)

    async def approach(self, touches: Touches, met_mm: float | None = None) -> tuple[GripStep | None, GripStep]:
        """Close step by step until the gel is touched, then once more, as finely as the gripper can.

        The onset's width is what every closing is counted from, so it is found to a count of the gripper. On the way
        one frame without a pause is enough; where it shows a contact, a full step at the same width has to confirm it.

        Args:
            touches: judges a step's frames.
            met_mm: where the same fruit was met before, so that the way there needs no images; None for a new fruit.

        Returns:
            The last step before the contact, with one frame, and the first with it.

        Raises:
            NothingTouchedError: nothing was touched down to the recipe's smallest width.
            UnseenContactError: the gripper was stopped by something and the gel shows nothing.
        """
        expected, step_mm = self._recipe.expected_width, self._recipe.steps.step_mm
        widest_mm = self._cell.gripper.max_width_mm
        from_mm = expected.largest_mm if met_mm is None else met_mm + SEARCH_AGAIN_STEPS * step_mm
        seen_mm, _ = await self._search(min(from_mm, widest_mm), step_mm, touches, one_ahead=True)
        from_mm, before = seen_mm, None
        while before is None and from_mm < widest_mm:  # back to where nothing touches, however faintly it began
            from_mm = min(from_mm + step_mm, widest_mm)
            seen_mm, before = await self._search(from_mm, FINEST_STEP_MM, touches, one_ahead=False)
        while not await touches(start := await self.step(0, seen_mm)):
            seen_mm, nearer = await self._search(seen_mm - FINEST_STEP_MM, FINEST_STEP_MM, touches, one_ahead=False)
            before = nearer or before
        return before, start

    async def _search(
        self, from_mm: float, stride_mm: float, touches: Touches, *, one_ahead: bool
    ) -> tuple[float, GripStep | None]:
        """Close stride by stride with one frame each, where wanted with the next stride made while a frame is judged.

        Returns:
            The width at which the gel was touched first, and the step before it.
        """
        expected = self._recipe.expected_width
        width_mm, before = from_mm, None
        step = await self._glance(width_mm)
        while width_mm >= expected.smallest_mm - self._recipe.steps.step_mm:
            judging = asyncio.ensure_future(touches(step))
            ahead = None
            try:
                if one_ahead:
                    ahead = await self._glance_ahead(width_mm - stride_mm, judging)
            finally:
                touched = await judging
            held = step.move.reading.object_state is ObjectState.CONTACT_CLOSING
            if touched:
                return width_mm, before
            if held:
                raise UnseenContactError(
                    f"the gripper holds something at {step.move.width_mm:.1f} mm which the gel does not show: look "
                    "for what stands between the fingers beside the gel, then `station devices check`"
                )
            width_mm, before = width_mm - stride_mm, step
            step = ahead or await self._glance(width_mm)
        raise NothingTouchedError(
            f"nothing was touched from {expected.largest_mm:g} down to {expected.smallest_mm:g} mm: is a "
            f"{self._recipe.name} in the nest, and is the arm there?"
        )

    async def _glance(self, width_mm: float) -> GripStep:
        move = await self.close_to(width_mm)
        return GripStep(-1, move, await self.sound_frames(1))

    async def _glance_ahead(self, width_mm: float, judging: asyncio.Future[bool]) -> GripStep | None:
        """Glance at the next width, unless the one before is found to touch; then the fingers stop on their way."""
        moving = asyncio.ensure_future(self.close_to(width_mm))
        try:
            await asyncio.wait({moving, judging}, return_when=asyncio.FIRST_COMPLETED)
            if not moving.done() and judging.result():
                await self._cell.gripper.stop()
                with contextlib.suppress(GripperStoppedError):
                    await moving
                return None
            move = await moving
            if judging.done() and judging.result():
                return None
            return GripStep(-1, move, await self.sound_frames(1))
        finally:
            moving.cancel()
            await asyncio.gather(moving, return_exceptions=True)

    async def let_go(self) -> str | None:
        """Open, then leave: an arm that leaves with closed fingers would tear what they hold.

        Returns:
            What could not be done, in words.
        """
        try:
            await self._cell.gripper.open()
        except StationError as error:
            return f"The gripper could not be opened, and the arm stays where it is: {error}"
        try:
            await self.go("above_nest", "home")
        except StationError as error:
            return f"The gripper is open, and the arm stays where it is: {error}"
        return None

    async def _sound_frame(self, newer_than_s: float) -> Frame:
        faults: set[FrameFault] = set()
        for _ in range(_MOST_FAULTY_FRAMES):
            frame = await self._cell.camera.frame(newer_than_s, self._frame_deadline_s)
            self._on_frame(frame)
            if not frame.faults:
                return frame
            faults |= frame.faults
            newer_than_s = frame.captured_s
        raise FramesError(
            f"the camera gave {_MOST_FAULTY_FRAMES} bad frames in a row ({', '.join(sorted(faults))}); "
            "see `station devices check`",
            faults,
        )
