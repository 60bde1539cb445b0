"""Motion without a stop: the sweep to the fruit, and closing on it, with the width at each frame's capture."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from station.press import stop
from station.press.rig import MeasuredStep, MovingRig, Position, Step
from station.settings.recipe_model import Recipe


class Met(NamedTuple):
    """Widths at the first frame with a contact, and the last without one, of closing without a stop."""

    width_mm: float
    """At the first frame with a contact."""
    clear_mm: float | None
    """At the last frame without one; None where there was none."""


class _Read(NamedTuple):
    """A reading of the fingers while they move."""

    position: Position
    """Its time is the middle of the exchange."""
    within_s: float
    """Half the exchange: its width may be so much earlier or later."""


Measure = Callable[[Step], Awaitable[MeasuredStep]]
"""Measures a step by itself."""
GoesOn = Callable[[Step], Awaitable[bool]]
"""Says whether the fingers may close further than in a step's frames."""


async def sweep(rig: MovingRig, recipe: Recipe, measure: Measure) -> Met:
    """Close from the present width without a stop until the newest frame, measured alone, shows a contact.

    The fingers wait for a measurement that is late, so that they are never more than `stop.MOST_UNSEEN_MM` and the way
    of one reaction further than what was measured, or than where they began while nothing is measured yet. Where every
    measurement is late, a frame of the waiting fingers is measured before they go on: so they get on all the same.

    Raises:
        NothingTouchedError: nothing was touched down to the recipe's smallest width.
        UnseenContactError: the fingers were stopped by something and the gel shows nothing.
    """
    unseen_s = stop.longest_unseen_s(recipe)
    readings = [await _read(rig)]
    clear_mm: float | None = None
    newer_than_s = stopped_s = time.monotonic()
    # At once: the reference has just shown the gel free, and what touches it now shows within the way of one reaction.
    moving: asyncio.Future[Position] | None = asyncio.ensure_future(rig.close_to(stop.lowest_mm(recipe)))
    try:
        while True:
            # Checked before the frame is taken: only a frame from after the move's end shows that nothing was met.
            ended = moving if moving is not None and moving.done() else None
            if ended is not None:
                newer_than_s = ended.result().at_s
            seeing = asyncio.ensure_future(_seen(rig, newer_than_s, readings, measure))
            try:
                await asyncio.wait({seeing}, timeout=max(0.0, newer_than_s + unseen_s - time.monotonic()))
                if not seeing.done() and moving is not None and not moving.done():
                    await rig.stop(moving)
                    moving, stopped_s = None, time.monotonic()
                seen = await seeing
            finally:
                # Where this task is cancelled, `asyncio.wait` does not cancel what it waits for.
                seeing.cancel()
            if stop.touches(seen):
                if moving is not None:
                    await rig.stop(moving)
                    moving = None
                return Met(seen.step.move.width_mm, clear_mm)
            if ended is not None:
                raise stop.nothing_touched(recipe, ended.result())
            clear_mm, newer_than_s = seen.step.move.width_mm, seen.step.last_frame.captured_s
            if moving is None:
                waited, now_s = newer_than_s > stopped_s, time.monotonic()
                if not waited and now_s > newer_than_s + unseen_s / 2:
                    newer_than_s = stopped_s  # little or nothing of the unseen way is left since that frame
                    continue
                # The fingers have waited at that frame's width until now, so their unseen way begins now.
                newer_than_s = now_s if waited else newer_than_s
                moving = asyncio.ensure_future(rig.close_to(stop.lowest_mm(recipe)))
    finally:
        if moving is not None:
            moving.cancel()
            await asyncio.gather(moving, return_exceptions=True)


async def close_on(rig: MovingRig, recipe: Recipe, width_mm: float, goes_on: GoesOn) -> Position:
    """Close to a width without a stop, and hand on every frame that was captured on the way.

    A measurement that is late costs no frame: those that come meanwhile wait for it. A frame whose width is not known
    to a count of the gripper, as its readings took too long, is left out.

    Args:
        width_mm: the width to ask for; less than 0 is 0.
        goes_on: gets each frame with the width at its capture, in their order, and says whether the fingers may close
            further.

    Returns:
        Where the fingers came to rest.
    """
    readings = [await _read(rig)]
    start_mm, newer_than_s = readings[0].position.width_mm, readings[0].position.at_s
    passed: asyncio.Queue[Step | None] = asyncio.Queue()
    moving = asyncio.ensure_future(rig.close_to(width_mm))
    measuring = asyncio.ensure_future(_all_go_on(passed, goes_on))
    try:
        while not moving.done():
            passing = asyncio.ensure_future(_passing(rig, newer_than_s, readings))
            try:
                await asyncio.wait({passing, moving, measuring}, return_when=asyncio.FIRST_COMPLETED)
                if not passing.done():
                    break
                step = await passing
            finally:
                passing.cancel()
            newer_than_s = step.last_frame.captured_s
            # The frame was captured between two of the last three readings.
            doubt_mm = max(each.within_s for each in readings[-3:]) * recipe.gripper.speed_mm_s
            # A frame of fingers that have not moved yet is no image on the way.
            if step.move.width_mm < start_mm and doubt_mm <= rig.finest_step_mm:
                passed.put_nowait(step)
        if moving.done():
            # Raises the gripper's fault, if the move ended by one.
            moving.result()
            passed.put_nowait(None)
        if await measuring:
            return await moving
        await rig.stop(moving)
        return await rig.read()
    finally:
        moving.cancel()
        measuring.cancel()
        await asyncio.gather(moving, measuring, return_exceptions=True)


async def _seen(rig: MovingRig, newer_than_s: float, readings: list[_Read], measure: Measure) -> MeasuredStep:
    """The next frame with the width at its capture, measured."""
    return await measure(await _passing(rig, newer_than_s, readings))


async def _passing(rig: MovingRig, newer_than_s: float, readings: list[_Read]) -> Step:
    """The next frame with the width at its capture, interpolated between readings."""
    frame = await rig.frame(newer_than_s)
    # Read after the frame has come, so that its capture is between two readings and no width is extrapolated.
    readings.append(await _read(rig))
    times_s = [each.position.at_s for each in readings]
    width_mm = float(np.interp(frame.captured_s, times_s, [each.position.width_mm for each in readings]))
    return Step(-1, replace(readings[-1].position, width_mm=width_mm, at_s=frame.captured_s), (frame,))


async def _read(rig: MovingRig) -> _Read:
    """Read the fingers while they may move."""
    position = await rig.read()
    within_s = (time.monotonic() - position.at_s) / 2
    return _Read(replace(position, at_s=position.at_s + within_s), within_s)


async def _all_go_on(passed: "asyncio.Queue[Step | None]", goes_on: GoesOn) -> bool:
    """Return whether the fingers may close further by every frame of the queue, up to None."""
    while (step := await passed.get()) is not None:
        if not await goes_on(step):
            return False
    return True
