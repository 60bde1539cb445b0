"""Device rig: camera, gripper and arm of the station as a press rig."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Collection, Coroutine
from dataclasses import dataclass
from typing import TypeVar

from station.devices.arm.arm import Arm
from station.devices.camera.interface import Camera, Frame, FrameFault, describe
from station.devices.gripper.errors import GripperStoppedError, GripperTimeoutError
from station.devices.gripper.interface import Gripper, GripperReading, MoveResult, ObjectState
from station.errors import StationError
from station.inspection.press import FINEST_STEP_MM
from station.messages import grip as messages
from station.messages.gripper import REMEDY_LATE
from station.messages.message import Definition, Message
from station.press.reference import are_open
from station.press.rig import GripError, Position
from station.settings.arm import PoseName
from station.settings.recipe_model import Recipe

FRAME_DEADLINE_S = 1.0
"""Longest wait for one frame, s: an estimate."""
_MOST_FAULTY_FRAMES = 10
"""Frames with a fault in a row that end a press: an estimate."""
HEALTH_LEASE_S = 2.0
"""Time after which the controller stops an arm whose lease was not renewed, s: an estimate."""
_FREE_WITHIN_MM = 1.0
"""How far short of a width beside a fruit jaws still let it go, mm: above the 2 counts of 0.4 mm within which the
gripper counts as at its place, and below `FREED_BY_MM` of `station.inspection.second_press`."""


T = TypeVar("T")


class FramesError(GripError):
    """The camera gives frames, and none that can be measured."""

    def __init__(self, message: Message, faults: Collection[FrameFault]) -> None:
        super().__init__(message)
        self.faults = frozenset(faults)
        """What was wrong with them."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The devices of one station, ready to be used; no arm on a bench."""

    camera: Camera
    gripper: Gripper
    arm: Arm | None


class DeviceRig:
    """The moves and frames of a press by a recipe's speed, force and settle time, with opened devices.

    Args:
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
        self.finest_step_mm = FINEST_STEP_MM

    @property
    def widest_mm(self) -> float:
        """The gripper's."""
        return self._cell.gripper.max_width_mm

    async def make_ready(self) -> None:
        """Activate the gripper: one that is not travels its whole way."""
        await self._cell.gripper.activate()

    async def go(self, *poses: PoseName) -> None:
        """Bring the arm to one pose after the other; without an arm nothing moves.

        Raises:
            ArmFault: the arm did not get there.
        """
        if self._cell.arm is not None:
            for pose in poses:
                await self._cell.arm.move_to(pose)

    async def leave_nest(self) -> None:
        """Bring the arm home, over the place above the nest."""
        await self.go("above_nest", "home")

    async def enter_nest(self) -> None:
        """Bring the arm down to the nest."""
        await self.go("above_nest", "nest")

    async def open(self, width_mm: float | None = None) -> Position:
        """Open fast: fully, or to a width."""
        return _position(await self._cell.gripper.open(width_mm))

    async def close_to(self, width_mm: float) -> Position:
        """Move the fingers at the recipe's speed and force; a width of less than 0 is 0."""
        grip = self._recipe.gripper
        return _position(await self._cell.gripper.move_to_width(max(0.0, width_mm), grip.speed_mm_s, grip.force_n))

    async def settle(self) -> None:
        """Wait for the recipe's settle time."""
        await asyncio.sleep(self._recipe.imaging.settle_s)

    async def frames(self, number: int) -> tuple[Frame, ...]:
        """Frames captured from now on with nothing wrong with them.

        Raises:
            FramesError: too many in a row had a fault.
            NoFrameError: none came in time.
        """
        frames: list[Frame] = []
        newer_than_s = time.monotonic()
        while len(frames) < number:
            frames.append(await self.frame(newer_than_s))
            newer_than_s = frames[-1].captured_s
        return tuple(frames)

    async def frame(self, newer_than_s: float) -> Frame:
        """The first frame with nothing wrong with it captured after a monotonic time.

        Raises:
            FramesError, NoFrameError: as `frames`.
        """
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

    async def read(self) -> Position:
        """Read the gripper."""
        return _read(await self._cell.gripper.read())

    async def stop(self, moving: asyncio.Future[Position]) -> None:
        """Stop the fingers where they are, and wait until the move under way has ended."""
        await self._cell.gripper.stop()
        with contextlib.suppress(GripperStoppedError):
            await moving

    async def release(self, failed: Message | None = None) -> None:
        """Open, then leave: an arm that leaves with closed fingers would tear what they hold.

        Raises:
            GripError: the gripper did not open, or the arm did not leave; it names what had failed before, too.
        """
        try:
            await open_freely(self._cell.gripper)
        except StationError as error:
            raise GripError(
                _combined(failed, error.message, messages.NOT_OPENED, messages.FAILED_NOT_OPENED)
            ) from error
        try:
            await self.leave_nest()
        except StationError as error:
            left = _combined(failed, error.message, messages.NOT_LEFT, messages.FAILED_NOT_LEFT)
            raise GripError(left) from error


async def open_freely(gripper: Gripper, width_mm: float | None = None) -> MoveResult:
    """Open fast, fully or to a width, and require that nothing stopped the fingers before: what they hold is not free.

    Raises:
        GripperTimeoutError: something stopped them.
        GripperError: as `Gripper.open`.
    """
    move = await gripper.open(width_mm)
    if width_mm is None:
        is_free = are_open(move.width_mm, move.requested_width_mm)
    else:
        is_free = move.width_mm >= move.requested_width_mm - _FREE_WITHIN_MM
    if move.reading.object_state is ObjectState.CONTACT_OPENING and not is_free:
        not_open = messages.JAWS_NOT_OPEN(width_mm=move.width_mm, open_mm=move.requested_width_mm)
        raise GripperTimeoutError(not_open, REMEDY_LATE())
    return move


def _position(move: MoveResult) -> Position:
    """The fingers at a move's end."""
    return _read(move.reading, move.requested_width_mm)


def _read(reading: GripperReading, requested_mm: float | None = None) -> Position:
    """The fingers as the gripper reads them."""
    held = reading.object_state is ObjectState.CONTACT_CLOSING
    return Position(
        reading.width_mm,
        reading.at_s,
        held,
        held or reading.object_state is ObjectState.CONTACT_OPENING,
        requested_mm,
        reading.object_state.value,
        reading.current_a,
    )


def _combined(after: Message | None, reason: Message, alone: Definition, with_same_reason: Definition) -> Message:
    """Return why the station could not release, with what failed before; a reason of both appears once."""
    if after is None:
        return alone(reason=reason)
    if after == reason:
        return with_same_reason(reason=reason)
    return messages.FAILED_TWICE(reason=after, release=alone(reason=reason))


async def at_once(*works: Coroutine[None, None, T]) -> list[T]:
    """Run coroutines, not started yet, concurrently; if one fails the others are cancelled, and its error is raised.

    Returns:
        Their results, in their order.
    """
    try:
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(work) for work in works]
    except ExceptionGroup as failed:
        raise failed.exceptions[0] from None
    return [task.result() for task in tasks]


@contextlib.asynccontextmanager
async def renewed_lease(arm: Arm | None) -> AsyncIterator[None]:
    """Renew an arm's lease while this program's loop runs: if the loop hangs, the controller stops the arm."""

    async def renew(arm: Arm) -> None:
        while True:
            arm.renew_health(HEALTH_LEASE_S)
            await asyncio.sleep(HEALTH_LEASE_S / 4)

    if arm is None:
        yield
        return
    renewing = asyncio.create_task(renew(arm), name="arm's health")
    try:
        yield
    finally:
        renewing.cancel()
        await asyncio.gather(renewing, return_exceptions=True)
