"""The parts of a grip: sound frames, width steps, the approach, letting go. Why it grips is not known here."""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Collection, Coroutine
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Camera, Frame, FrameFault, Image, describe
from station.devices.gripper.errors import GripperStoppedError
from station.devices.gripper.interface import Gripper, GripperReading, MoveResult, ObjectState
from station.errors import StationError
from station.messages import grip as messages
from station.messages.message import Definition, Message
from station.settings.arm import PoseName
from station.settings.recipe import Recipe
from station.vision.step import mean_image

FRAME_DEADLINE_S = 1.0
FINEST_STEP_MM = 0.4
"""A count of the gripper."""
MOST_UNSEEN_MM = 3.0
"""So far the fingers may have gone since the frame that was measured last: as far as the twin's flesh bears without
yielding (the recipes' damage limits). What they go in fact is in docs/cycle-time.md."""
_MOST_FAULTY_FRAMES = 10


class GripError(StationError):
    """The grip could not be carried through; the message says at which step and why."""


class FramesError(GripError):
    """The camera gives frames, and none that can be measured."""

    def __init__(self, message: Message, faults: Collection[FrameFault]) -> None:
        super().__init__(message)
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


class Met(NamedTuple):
    """Where closing without a stop has met something."""

    width_mm: float
    """At the first frame with a contact."""
    clear_mm: float | None
    """At the last frame without one; None where there was none."""


class _Read(NamedTuple):
    """A reading of the gripper while it moves."""

    reading: GripperReading
    """Its time is the middle of the exchange."""
    within_s: float
    """Half the exchange: its width may be so much earlier or later."""


Touches = Callable[[GripStep], Awaitable[bool]]
"""Says whether the gel is touched in a step's frames."""
GoesOn = Callable[[GripStep], Awaitable[bool]]
"""Says whether the fingers may close further than in a step's frames."""


async def at_once(*works: Coroutine[None, None, object]) -> None:
    """Do several things at the same time; where one fails the others are cancelled, and its error is raised.

    Args:
        works: not begun yet.
    """
    try:
        async with asyncio.TaskGroup() as group:
            for work in works:
                group.create_task(work)
    except ExceptionGroup as failed:
        raise failed.exceptions[0] from None


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

    async def approach(self, touches: Touches) -> tuple[GripStep | None, GripStep]:
        """Close until the gel is touched, then once more from where it was not, as finely as the gripper can.

        The onset's width is what every closing is counted from, so it is found to a count of the gripper. On the way
        one frame without a pause is enough; where it shows a contact, a full step at the same width has to confirm it.

        Args:
            touches: judges a step's frames.

        Returns:
            The last step before the contact, with one frame, and the first with it.

        Raises:
            NothingTouchedError: nothing was touched down to the recipe's smallest width.
            UnseenContactError: the gripper was stopped by something and the gel shows nothing.
        """
        return await self.onset(await self.sweep(touches), touches)

    async def sweep(self, touches: Touches) -> Met:
        """Close from the present width without a stop until the newest frame shows a contact.

        The fingers wait for a measurement that is late, so that they are never more than `MOST_UNSEEN_MM` and the way
        of one reaction further than what was measured.

        Args:
            touches: judges a step's frames.

        Raises:
            NothingTouchedError, UnseenContactError: as `approach`.
        """
        recipe = self._recipe
        lowest_mm = recipe.expected_width.smallest_mm - recipe.steps.step_mm
        unseen_s = MOST_UNSEEN_MM / recipe.gripper.speed_mm_s
        readings = [await self._read()]
        clear_mm: float | None = None
        newer_than_s = time.monotonic()
        moving: asyncio.Future[MoveResult] | None = None
        try:
            while True:
                ended = moving if moving is not None and moving.done() else None
                if ended is not None:
                    newer_than_s = ended.result().reading.at_s
                seeing = asyncio.ensure_future(self._seen(newer_than_s, readings, touches))
                try:
                    await asyncio.wait({seeing}, timeout=max(0.0, newer_than_s + unseen_s - time.monotonic()))
                    if not seeing.done() and moving is not None and not moving.done():
                        await self._halt(moving)
                        moving = None
                    step, touched = await seeing
                finally:
                    seeing.cancel()
                if touched:
                    if moving is not None:
                        await self._halt(moving)
                        moving = None
                    return Met(step.move.width_mm, clear_mm)
                if ended is not None:
                    raise self._nothing_touched(ended.result())
                clear_mm, newer_than_s = step.move.width_mm, step.last_frame.captured_s
                moving = moving or asyncio.ensure_future(self.close_to(lowest_mm))
        finally:
            if moving is not None:
                moving.cancel()
                await asyncio.gather(moving, return_exceptions=True)

    async def onset(self, met: Met, touches: Touches) -> tuple[GripStep | None, GripStep]:
        """Find the onset count by count, from a width at which nothing touches.

        Args:
            met: where the sweep has met the fruit.
            touches: judges a step's frames.

        Returns:
            The last step before the contact, with one frame, and the first with it.

        Raises:
            NothingTouchedError, UnseenContactError: as `approach`.
        """
        widest_mm, step_mm = self._cell.gripper.max_width_mm, self._recipe.steps.step_mm
        # A light contact begins unseen: half a count of room for it.
        from_mm = (met.width_mm if met.clear_mm is None else met.clear_mm) + FINEST_STEP_MM / 2
        before = None
        while True:  # back to where nothing touches, however faintly it began
            from_mm = min(from_mm, widest_mm)
            await self._cell.gripper.open(from_mm)
            seen_mm, before = await self._search(from_mm, touches)
            if before is not None or from_mm >= widest_mm:
                break
            from_mm += step_mm
        # Without the pause of a step: nothing creeps yet where nothing is pressed.
        while not await touches(start := await self._glance(seen_mm, 0, self._recipe.imaging.frames_per_step)):
            seen_mm, nearer = await self._search(seen_mm - FINEST_STEP_MM, touches)
            before = nearer or before
        return before, start

    async def close_on(self, width_mm: float, goes_on: GoesOn) -> MoveResult:
        """Close to a width without a stop, and hand on every frame that was captured on the way.

        A measurement that is late costs no frame: those that come meanwhile wait for it. A frame whose width is not
        known to a count of the gripper, as its readings took too long, is left out.

        Args:
            width_mm: the width to ask for; less than 0 is 0.
            goes_on: gets each frame with the width at its capture, in their order, and says whether the fingers may
                close further.

        Returns:
            Where the fingers came to rest.
        """
        readings = [await self._read()]
        start_mm, newer_than_s = readings[0].reading.width_mm, readings[0].reading.at_s
        passed: asyncio.Queue[GripStep | None] = asyncio.Queue()
        moving = asyncio.ensure_future(self.close_to(width_mm))
        measuring = asyncio.ensure_future(_all_go_on(passed, goes_on))
        try:
            while not moving.done():
                passing = asyncio.ensure_future(self._passing(newer_than_s, readings))
                try:
                    await asyncio.wait({passing, moving, measuring}, return_when=asyncio.FIRST_COMPLETED)
                    if not passing.done():
                        break
                    step = await passing
                finally:
                    passing.cancel()
                newer_than_s = step.last_frame.captured_s
                # The frame was captured between two of the last three readings.
                doubt_mm = max(each.within_s for each in readings[-3:]) * self._recipe.gripper.speed_mm_s
                if step.move.width_mm < start_mm and doubt_mm <= FINEST_STEP_MM:
                    passed.put_nowait(step)
            if moving.done():
                moving.result()
                passed.put_nowait(None)
            if await measuring:
                return await moving
            await self._halt(moving)
            at = await self._cell.gripper.read()
            return MoveResult(at.width_mm, at.echoed_count, at)
        finally:
            moving.cancel()
            measuring.cancel()
            await asyncio.gather(moving, measuring, return_exceptions=True)

    async def _seen(self, newer_than_s: float, readings: list[_Read], touches: Touches) -> tuple[GripStep, bool]:
        """The next frame with the width at its capture; and whether it shows a contact."""
        step = await self._passing(newer_than_s, readings)
        return step, await touches(step)

    async def _passing(self, newer_than_s: float, readings: list[_Read]) -> GripStep:
        """The next frame with the width at its capture, interpolated between readings."""
        frame = await self._sound_frame(newer_than_s)
        readings.append(await self._read())
        times_s = [each.reading.at_s for each in readings]
        width_mm = float(np.interp(frame.captured_s, times_s, [each.reading.width_mm for each in readings]))
        at_capture = replace(readings[-1].reading, width_mm=width_mm, at_s=frame.captured_s)
        return GripStep(-1, MoveResult(width_mm, at_capture.echoed_count, at_capture), (frame,))

    async def _read(self) -> _Read:
        """Read the gripper while it may move."""
        reading = await self._cell.gripper.read()
        within_s = (time.monotonic() - reading.at_s) / 2
        return _Read(replace(reading, at_s=reading.at_s + within_s), within_s)

    async def _halt(self, moving: asyncio.Future[MoveResult]) -> None:
        """Stop the fingers where they are."""
        await self._cell.gripper.stop()
        with contextlib.suppress(GripperStoppedError):
            await moving

    async def _search(self, from_mm: float, touches: Touches) -> tuple[float, GripStep | None]:
        """Close count by count with one frame each.

        Returns:
            The width at which the gel was touched first, and the step before it.
        """
        width_mm, before = from_mm, None
        while width_mm >= self._recipe.expected_width.smallest_mm - self._recipe.steps.step_mm:
            step = await self._glance(width_mm)
            if await touches(step):
                return width_mm, before
            if step.move.reading.object_state is ObjectState.CONTACT_CLOSING:
                raise self._nothing_touched(step.move)
            width_mm, before = width_mm - FINEST_STEP_MM, step
        raise self._nothing_touched()

    def _nothing_touched(self, move: MoveResult | None = None) -> GripError:
        """The error for fingers that have closed without a contact, held by something or not."""
        if move is not None and move.reading.object_state is ObjectState.CONTACT_CLOSING:
            return UnseenContactError(messages.UNSEEN_CONTACT(width_mm=move.width_mm))
        expected = self._recipe.expected_width
        return NothingTouchedError(
            messages.NOTHING_TOUCHED(
                largest_mm=expected.largest_mm, smallest_mm=expected.smallest_mm, recipe=self._recipe.name
            )
        )

    async def _glance(self, width_mm: float, number: int = -1, frames: int = 1) -> GripStep:
        move = await self.close_to(width_mm)
        return GripStep(number, move, await self.sound_frames(frames))

    async def let_go(self, after: Message | None = None) -> Message | None:
        """Open, then leave: an arm that leaves with closed fingers would tear what they hold.

        Args:
            after: what failed before; part of what is returned.

        Returns:
            What could not be done; None if all was.
        """
        try:
            await self._cell.gripper.open()
        except StationError as error:
            return _combined(after, error.message, messages.NOT_OPENED, messages.FAILED_NOT_OPENED)
        try:
            await self.go("above_nest", "home")
        except StationError as error:
            return _combined(after, error.message, messages.NOT_LEFT, messages.FAILED_NOT_LEFT)
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
            messages.BAD_FRAMES(number=_MOST_FAULTY_FRAMES, faults=describe(faults)),
            faults,
        )


async def _all_go_on(passed: "asyncio.Queue[GripStep | None]", goes_on: GoesOn) -> bool:
    """Whether the fingers may close further in every frame up to None."""
    while (step := await passed.get()) is not None:
        if not await goes_on(step):
            return False
    return True


def _combined(after: Message | None, reason: Message, alone: Definition, with_same_reason: Definition) -> Message:
    """Return what kept the station from letting go, with what failed before; a reason of both appears once."""
    if after is None:
        return alone(reason=reason)
    if after == reason:
        return with_same_reason(reason=reason)
    return messages.FAILED_TWICE(reason=after, release=alone(reason=reason))
