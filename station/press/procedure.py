"""Press procedure: reference, approach, contact, compression steps, release, on any rig.

`press` is the whole; the station's cycle and the ball's procedures call its parts, since more happens between them.
What differs is the rig and the observer.
"""

import asyncio
from typing import NamedTuple, Protocol

from station.errors import StationError
from station.messages import grip as messages
from station.messages.message import Message
from station.press import stop
from station.press.motion import GoesOn, Measure, Met, sweep
from station.press.reference import take_reference
from station.press.rig import MeasuredStep, MovingRig, Position, Rig, Step
from station.settings.recipe_model import Recipe


class Onset(NamedTuple):
    """The contact onset."""

    before: Step | None
    """The last step without a contact, of one frame; None where there was none."""
    start: MeasuredStep
    """The first with it."""


class Observer(Protocol):
    """Observer of a press."""

    async def see_reference(self, untouched: Step) -> None:
        """Get the reference's frames, against which the steps are measured."""
        ...

    async def measure(self, step: Step) -> MeasuredStep:
        """Measure a step of the approach by itself."""
        ...

    async def see_step(self, step: Step) -> bool:
        """Get a step of the press, the last one before the contact first, and return whether another may be made."""
        ...


async def press(rig: MovingRig, recipe: Recipe, observer: Observer) -> None:
    """Press what is in the nest, if anything, and release it in any case. Not idempotent: each call presses.

    Raises:
        GripError: no sound frame came, nothing was touched, or the fingers or the arm did not return.
        StationError: a device's fault; the fingers are open by then, if they could move.
    """
    failed: Message | None = None
    try:
        await observer.see_reference(await take_reference(rig, recipe.imaging.reference_frames))
        start = await _start(rig, recipe, observer)
        if start is not None:
            await close_in_steps(rig, recipe, start.move.width_mm, observer.see_step)
    except (StationError, asyncio.CancelledError) as error:
        failed = error.message if isinstance(error, StationError) else messages.CALLED_OFF()
        raise
    finally:
        await release_to_the_end(rig, failed)


async def release_to_the_end(rig: Rig, failed: Message | None = None) -> None:
    """Release by `Rig.release`, also where the caller is cancelled meanwhile: jaws must not stop halfway on a fruit.

    Raises:
        GripError: as `Rig.release`.
        asyncio.CancelledError: the caller was cancelled meanwhile; raised once the fruit is released.
    """
    called_off: asyncio.CancelledError | None = None
    releasing = asyncio.create_task(rig.release(failed), name="release")
    while not releasing.done():
        try:
            # `asyncio.wait` does not cancel what it waits for, so a cancellation does not interrupt the opening.
            await asyncio.wait({releasing})
        except asyncio.CancelledError as error:
            called_off = error
    releasing.result()
    if called_off is not None:
        raise called_off


async def _start(rig: MovingRig, recipe: Recipe, observer: Observer) -> Step | None:
    """The press's first step; None where no further one may be made."""
    if recipe.steps.start_width_mm is not None:
        start = await take_step(rig, recipe, 0, recipe.steps.start_width_mm)
    else:
        opened = await back_off(rig, await sweep(rig, recipe, observer.measure))
        before, first = await onset(rig, recipe, opened, observer.measure)
        start = first.step
        if before is not None:
            await observer.see_step(before)
    return start if await observer.see_step(start) else None


async def take_step(rig: Rig, recipe: Recipe, number: int, width_mm: float) -> Step:
    """Go to a width (less than 0 is 0), let fruit and gel settle, and take the recipe's frames."""
    move = await rig.close_to(width_mm)
    await rig.settle()
    return Step(number, move, await rig.frames(recipe.imaging.frames_per_step))


async def close_in_steps(rig: Rig, recipe: Recipe, start_mm: float, goes_on: GoesOn) -> None:
    """Close by the recipe's steps, in measured widths from the first step's, until the recipe or `goes_on` ends it."""
    for number in range(1, recipe.steps.number + 1):
        # From the first step's width, so that the deviations of the gripper's counts do not add up.
        if not await goes_on(await take_step(rig, recipe, number, start_mm - number * recipe.steps.step_mm)):
            return


async def back_off(rig: Rig, met: Met) -> Position:
    """Open to where the sweep saw nothing touch."""
    # A light contact begins unseen: half a count of room for it.
    from_mm = (met.width_mm if met.clear_mm is None else met.clear_mm) + rig.finest_step_mm / 2
    return await rig.open(min(from_mm, rig.widest_mm))


async def onset(rig: Rig, recipe: Recipe, opened: Position, measure: Measure, lowest_mm: float | None = None) -> Onset:
    """Find the onset as finely as the fingers can, from where nothing touches.

    The onset's width is what every closing is counted from.

    Args:
        opened: where the fingers have backed off to; they open further while something touches.
        lowest_mm: where the search ends in any case; None for the recipe's smallest width.

    Raises:
        NothingTouchedError, UnseenContactError: as `sweep`.
    """
    search = _Search(rig, recipe, stop.lowest_mm(recipe) if lowest_mm is None else lowest_mm, measure)
    from_mm = opened.width_mm
    while True:  # back to where nothing touches, however faintly it began
        # From the measured width: asked for from between two counts, a finest step may be two counts.
        wider = from_mm < rig.widest_mm
        met_mm, before, touching = await search.first_contact(opened.width_mm, opened, seen_clear=wider)
        if before is not None or not wider:
            return await search.confirmed(met_mm, before, touching)
        # The requested width grows, not the reached one: so it ends also where something keeps the jaws from opening.
        from_mm += recipe.steps.step_mm
        opened = await rig.open(min(from_mm, rig.widest_mm))


async def onset_again(rig: MovingRig, recipe: Recipe, met: Met, measure: Measure) -> Onset:
    """Find the onset of a fruit that was met before, from beside where it was; sweep where it is no longer there.

    Raises:
        NothingTouchedError, UnseenContactError: as `sweep`.
    """
    opened = await rig.close_to(met.width_mm if met.clear_mm is None else met.clear_mm)
    try:
        # One step further in: from there on a sweep is quicker than count by count.
        return await onset(rig, recipe, opened, measure, met.width_mm - recipe.steps.step_mm)
    except stop.NothingTouchedError:
        return await onset(rig, recipe, await back_off(rig, await sweep(rig, recipe, measure)), measure)


async def onset_from(rig: Rig, recipe: Recipe, from_mm: float, lowest_mm: float, measure: Measure) -> Onset:
    """Find the onset from a width at which nothing touches, down to `lowest_mm` at most, without a sweep.

    Raises:
        NothingTouchedError, UnseenContactError: as `sweep`.
    """
    search = _Search(rig, recipe, lowest_mm, measure)
    return await search.confirmed(*await search.first_contact(from_mm))


async def bracketed_onset_mm(
    rig: Rig, recipe: Recipe, untouched_mm: float, touched_mm: float, measure: Measure
) -> float:
    """Find the onset between a step without and a narrower one with contact, by full steps as fine as the fingers go.

    Returns:
        Its measured width; the smaller one where nothing touches before.
    """
    width_mm = untouched_mm - rig.finest_step_mm
    # Down to half a step above: nearer, the gripper would be at the touched width again.
    while width_mm > touched_mm + rig.finest_step_mm / 2:
        seen = await measure(await take_step(rig, recipe, 0, width_mm))
        if stop.touches(seen):
            return seen.step.move.width_mm
        width_mm -= rig.finest_step_mm
    return touched_mm


class _Search:
    """Closing in the fingers' finest steps with one frame each, until one shows a contact."""

    def __init__(self, rig: Rig, recipe: Recipe, lowest_mm: float, measure: Measure) -> None:
        self._rig, self._recipe, self._lowest_mm, self._measure = rig, recipe, lowest_mm, measure

    async def first_contact(
        self, from_mm: float, at: Position | None = None, *, seen_clear: bool = False
    ) -> tuple[float, Step | None, Step]:
        """Return the requested width of the first contact, the step before it, and the step itself.

        Args:
            from_mm: where the search begins.
            at: the fingers where they are there already.
            seen_clear: nothing touched there before. It is measured again only where the finest step after it shows a
                contact; where it does so too, the fingers are that step further than the one that is returned.
        """
        width_mm, before = from_mm, None
        unmeasured: Step | None = None
        while width_mm >= self._lowest_mm:
            move = at or await self._rig.close_to(width_mm)
            step, at = Step(-1, move, await self._rig.frames(1)), None
            next_mm = width_mm - self._rig.finest_step_mm
            # Only where a next step is measured in its place: not for held fingers, and not at the search's end.
            if seen_clear and not move.held and next_mm >= self._lowest_mm:
                seen_clear, before, unmeasured, width_mm = False, step, step, next_mm
                continue
            seen = await self._measure(step)
            if stop.touches(seen):
                if unmeasured is not None and stop.touches(wider := await self._measure(unmeasured)):
                    return width_mm + self._rig.finest_step_mm, None, wider.step
                return width_mm, before, seen.step
            if seen.step.move.held:
                raise stop.nothing_touched(self._recipe, seen.step.move)
            width_mm, before, unmeasured = next_mm, seen.step, None
        raise stop.nothing_touched(self._recipe)

    async def confirmed(self, width_mm: float, before: Step | None, touching: Step) -> Onset:
        """Confirm a contact by as many frames as a step has, at the same width; else search on.

        Args:
            width_mm: as requested.
            before: the last step without a contact.
            touching: the first with one; its frame is the first of those that confirm it.
        """
        # Without the pause of a step: nothing creeps yet where nothing is pressed.
        more = self._recipe.imaging.frames_per_step - 1
        while True:
            frames = (*touching.frames, *(await self._rig.frames(more) if more else ()))
            start = await self._measure(Step(0, touching.move, frames))
            if stop.touches(start):
                return Onset(before, start)
            width_mm, nearer, touching = await self.first_contact(width_mm - self._rig.finest_step_mm)
            # `nearer` is None where the next width shows a contact at once: the earlier `before` then remains.
            before = nearer or before
