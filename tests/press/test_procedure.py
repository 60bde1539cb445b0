"""The press procedure on a rig that is only written down: its order, its end, and what stops it."""

import asyncio
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from station.press.measurement import PressMeasurement
from station.press.procedure import onset, press
from station.press.reference import JawsNotOpenError
from station.press.rig import MeasuredStep, Position, Step
from station.press.stop import NothingTouchedError, UnseenContactError, is_last_step, may_decide
from station.settings.recipe import find_recipe

BLUEBERRY, BALL = find_recipe("blueberry"), find_recipe("rubber_ball")
WIDEST_MM, FRUIT_MM = 53.0, 15.3


class WrittenRig:
    """Fingers that are where they were sent, and note each verb."""

    widest_mm, finest_step_mm = WIDEST_MM, 0.4

    def __init__(self, opens_to_mm: float = WIDEST_MM, held_mm: float = 0.0, *, fruit_mm: float = FRUIT_MM) -> None:
        self.verbs: list[str] = []
        self._fruit_mm = fruit_mm
        self._width_mm, self._opens_to_mm, self._held_mm, self._now_s = 20.0, opens_to_mm, held_mm, 0.0

    async def make_ready(self) -> None:
        self.verbs.append("ready")

    async def leave_nest(self) -> None:
        self.verbs.append("leave")

    async def enter_nest(self) -> None:
        self.verbs.append("enter")

    async def open(self, width_mm: float | None = None) -> Position:
        self.verbs.append("open")
        self._width_mm = min(self._opens_to_mm, WIDEST_MM if width_mm is None else width_mm)
        return await self.read()

    async def close_to(self, width_mm: float) -> Position:
        self.verbs.append("close")
        self._width_mm = max(width_mm, self._held_mm)
        return await self.read()

    async def settle(self) -> None:
        self.verbs.append("settle")

    async def frame(self, newer_than_s: float) -> Any:
        await asyncio.sleep(0)
        self._now_s = newer_than_s + 0.03
        image = np.full((2, 2, 3), 1 if self._width_mm < self._fruit_mm else 0, np.uint8)
        return SimpleNamespace(image=image, sequence=1, captured_s=self._now_s)

    async def frames(self, number: int) -> tuple[Any, ...]:
        self.verbs.append(f"frames {number}")
        return tuple([await self.frame(self._now_s) for _ in range(number)])

    async def read(self) -> Position:
        held = self._held_mm > 0 and self._width_mm <= self._held_mm
        return Position(self._width_mm, self._now_s, held, blocked=held)

    async def stop(self, moving: asyncio.Future[Position]) -> None:
        await moving

    async def release(self, failed: Any = None) -> None:
        self.verbs.append("release" if failed is None else "release after a fault")


class WrittenObserver:
    """Notes the steps, and lets so many of them be made."""

    def __init__(self, most: int = 100) -> None:
        self.most, self.references, self.steps = most, 0, cast("list[Step]", [])

    async def see_reference(self, untouched: Step) -> None:
        self.references = len(untouched.frames)

    async def measure(self, step: Step) -> MeasuredStep:
        return cast("MeasuredStep", SimpleNamespace(step=step, contact=SimpleNamespace(is_firm=step.image.any())))

    async def see_step(self, step: Step) -> bool:
        self.steps.append(step)
        return len(self.steps) < self.most


def test_a_press_takes_the_reference_away_from_the_nest_then_steps_then_releases():
    rig, observer = WrittenRig(), WrittenObserver()
    asyncio.run(press(rig, BALL, observer))
    number = BALL.imaging.reference_frames
    step = ["close", "settle", f"frames {BALL.imaging.frames_per_step}"]
    begin = ["ready", "open", "leave", f"frames {number}", "enter"]
    assert rig.verbs == [*begin, *step * (1 + BALL.steps.number), "release"]
    assert observer.references == number
    widths_mm = [each.move.width_mm for each in observer.steps]
    assert np.diff(widths_mm) == pytest.approx([-BALL.steps.step_mm] * BALL.steps.number)


def test_an_onset_is_found_to_the_finest_step_and_the_step_before_it_is_handed_on_first():
    rig, observer = WrittenRig(), WrittenObserver(most=4)
    asyncio.run(press(rig, BLUEBERRY, observer))
    before, start, *steps = observer.steps
    assert (before.number, start.number) == (-1, 0)
    assert before.move.width_mm >= FRUIT_MM > start.move.width_mm
    assert before.move.width_mm - start.move.width_mm == pytest.approx(rig.finest_step_mm)
    assert [each.number for each in steps] == [1, 2], "the observer ends the steps"
    assert rig.verbs[-1] == "release"


def test_the_frame_that_shows_the_contact_first_is_one_of_those_that_confirm_it():
    rig, observer = WrittenRig(), WrittenObserver(most=2)
    asyncio.run(press(rig, BLUEBERRY, observer))
    start, number = observer.steps[1], BLUEBERRY.imaging.frames_per_step
    assert len(start.frames) == number
    assert rig.verbs[-4:-1] == ["close", "frames 1", f"frames {number - 1}"], "the jaws are not moved to confirm it"


def test_the_search_begins_where_the_jaws_have_opened_to_and_does_not_send_them_there_again():
    rig, observer = WrittenRig(), WrittenObserver(most=2)
    asyncio.run(press(rig, BLUEBERRY, observer))
    after_the_sweep = rig.verbs[rig.verbs.index("open", rig.verbs.index("enter")) :]
    follows = {after for verb, after in pairwise(after_the_sweep) if verb == "open"}
    assert follows == {"frames 1"}


def test_the_search_goes_count_by_count_also_where_the_jaws_were_asked_to_open_between_two_counts():
    count_mm, widths_mm = 0.373, list[float]()

    class Counted(WrittenRig):
        """Fingers that reach whole counts only."""

        def _count(self, width_mm: float) -> float:
            return round(width_mm / count_mm) * count_mm

        async def open(self, width_mm: float | None = None) -> Position:
            return await super().open(None if width_mm is None else self._count(width_mm))

        async def close_to(self, width_mm: float) -> Position:
            reached = await super().close_to(self._count(width_mm))
            widths_mm.append(reached.width_mm)
            return reached

    async def measure(step: Step) -> MeasuredStep:
        contact = SimpleNamespace(is_firm=bool(step.image.any()))
        return cast("MeasuredStep", SimpleNamespace(step=step, contact=contact))

    for over_mm in np.arange(0.0, count_mm, 0.02):
        rig = Counted()
        opened = asyncio.run(rig.open(FRUIT_MM + 4 * count_mm + over_mm))
        widths_mm.clear()
        asyncio.run(onset(rig, BLUEBERRY, opened, measure))
        assert -np.diff([opened.width_mm, *widths_mm]) == pytest.approx(count_mm), over_mm


@pytest.mark.parametrize(
    ("opened_mm", "measured_mm"),
    [
        (FRUIT_MM + 0.7, [0.3, -0.1, -0.1]),
        (FRUIT_MM + 0.1, [-0.3, 0.1, -0.3]),
        # A fruit that has come nearer meanwhile touches already: the jaws open by a step.
        (FRUIT_MM - 0.1, [-0.5, -0.1, 0.5, 0.1, -0.3, -0.3]),
    ],
    ids=["two steps", "one step", "none"],
)
def test_where_nothing_touched_is_measured_again_only_if_the_next_step_shows_a_contact(opened_mm, measured_mm):
    measured = list[float]()

    async def measure(step: Step) -> MeasuredStep:
        measured.append(step.move.width_mm - FRUIT_MM)
        contact = SimpleNamespace(is_firm=bool(step.image.any()))
        return cast("MeasuredStep", SimpleNamespace(step=step, contact=contact))

    async def scenario():
        rig = WrittenRig()
        async with asyncio.timeout(10):
            return rig, await onset(rig, BLUEBERRY, await rig.open(opened_mm), measure)

    rig, (before, start) = asyncio.run(scenario())
    assert measured == pytest.approx(measured_mm)
    assert before is not None
    assert before.move.width_mm >= FRUIT_MM > start.step.move.width_mm
    assert before.move.width_mm - start.step.move.width_mm == pytest.approx(rig.finest_step_mm)


def test_jaws_that_something_keeps_from_opening_further_have_the_onset_where_they_are():
    rig = WrittenRig(opens_to_mm=FRUIT_MM - 1.0)

    async def scenario():
        async with asyncio.timeout(10):
            return await onset(rig, BLUEBERRY, await rig.open(), WrittenObserver().measure)

    before, start = asyncio.run(scenario())
    assert before is None
    assert start.step.move.width_mm == FRUIT_MM - 1.0


def test_a_contact_that_is_not_confirmed_is_searched_on_from_there():
    rig, observer = WrittenRig(), WrittenObserver(most=2)
    flashes = [True]

    async def measure(step: Step) -> MeasuredStep:
        """Return a contact where the fruit is touched, and in one single frame before."""
        flash = step.number < 0 and step.move.width_mm < FRUIT_MM + 1.5 and bool(flashes)
        flashes[:] = [] if flash else flashes
        return cast(
            "MeasuredStep", SimpleNamespace(step=step, contact=SimpleNamespace(is_firm=flash or step.image.any()))
        )

    observer.measure = measure
    asyncio.run(press(rig, BLUEBERRY, observer))
    before, start = observer.steps
    assert not flashes
    assert before.move.width_mm >= FRUIT_MM > start.move.width_mm
    assert before.move.width_mm - start.move.width_mm == pytest.approx(rig.finest_step_mm)


def test_no_reference_is_taken_where_the_jaws_do_not_open():
    rig, observer = WrittenRig(opens_to_mm=50.0), WrittenObserver()
    with pytest.raises(JawsNotOpenError):
        asyncio.run(press(rig, BALL, observer))
    assert rig.verbs == ["ready", "open", "release after a fault"]


@pytest.mark.parametrize(("held_mm", "error"), [(15.5, UnseenContactError), (0.0, NothingTouchedError)])
def test_fingers_that_touch_nothing_release_and_name_what_held_them(held_mm, error):
    rig = WrittenRig(held_mm=held_mm, fruit_mm=0.0)
    with pytest.raises(error):
        asyncio.run(press(rig, BLUEBERRY, WrittenObserver()))
    assert rig.verbs[-1] == "release after a fault"


def test_a_press_that_is_called_off_releases():
    rig, observer = WrittenRig(), WrittenObserver()

    async def scenario() -> None:
        pressing = asyncio.ensure_future(press(rig, BLUEBERRY, observer))
        while not observer.steps:
            await asyncio.sleep(0)
        pressing.cancel()
        await pressing

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(scenario())
    assert rig.verbs[-1] == "release after a fault"


def test_a_press_that_a_defect_ends_releases():
    rig, observer = WrittenRig(), WrittenObserver()

    async def see_step(step: Step) -> bool:
        raise ValueError("no StationError")

    observer.see_step = see_step
    with pytest.raises(ValueError, match="no StationError"):
        asyncio.run(press(rig, BLUEBERRY, observer))
    assert rig.verbs[-1] == "release"


@pytest.mark.parametrize("cancelled_before", [True, False])
def test_a_release_comes_to_its_end_also_where_it_is_called_off_again(cancelled_before):
    rig, releasing, free = WrittenRig(), asyncio.Event(), asyncio.Event()
    observer = WrittenObserver(most=100 if cancelled_before else 1)

    async def release(failed: Any = None) -> None:
        releasing.set()
        await free.wait()
        rig.verbs.append("released")

    async def scenario() -> None:
        rig.release = release
        pressing = asyncio.ensure_future(press(rig, BLUEBERRY, observer))
        while not observer.steps:
            await asyncio.sleep(0)
        if cancelled_before:
            pressing.cancel()
        await releasing.wait()
        pressing.cancel()
        await asyncio.sleep(0)
        assert not pressing.done()
        free.set()
        await asyncio.wait({pressing})
        assert pressing.cancelled(), "no cancellation is lost"

    asyncio.run(scenario())
    assert rig.verbs[-1] == "released"


def test_the_last_step_is_the_recipes_the_force_limits_or_that_of_closed_fingers():
    number, free, held = BLUEBERRY.steps.number, Position(10.0), Position(10.0, held=True)
    assert not is_last_step(BLUEBERRY, number - 1, 1.0, free)
    assert is_last_step(BLUEBERRY, number, 1.0, free)
    assert is_last_step(BLUEBERRY, 1, 1.0, held)
    assert is_last_step(BLUEBERRY, 1, 0.0, free)


def test_a_measurement_is_awaited_only_where_the_step_may_decide():
    deciding_mm = BLUEBERRY.damage.deciding_closing_mm
    assert may_decide(BLUEBERRY, deciding_mm) == BLUEBERRY.steps.stop_when_decided
    assert not may_decide(BLUEBERRY, deciding_mm - 0.5)
    assert not may_decide(BLUEBERRY, None)


@pytest.mark.parametrize(
    ("is_firm", "again"), [(True, [20, 60, 30]), (False, [10, 20, 60, 30])], ids=["firm", "perhaps weak"]
)
def test_a_frame_that_has_shown_a_firm_contact_in_the_search_is_not_measured_again_to_confirm_it(is_firm, again):
    measured: list[tuple[int, bool]] = []

    class CountingMethod:
        """Remembers the level of each image that it measures."""

        def measure(self, image: Any, previous: Any = None, agreed: float = 1.0, *, firm_only: bool = False) -> Any:
            assert previous is None
            measured.append((int(image[0, 0, 0]), firm_only))
            return SimpleNamespace(confidence=None, area_px=0, is_firm=is_firm)

    frames = tuple(SimpleNamespace(image=np.full((2, 2, 3), level, np.uint8)) for level in (10, 20, 60))
    measurement = PressMeasurement(cast("Any", CountingMethod()))
    measurement.prepare_next(frames[0].image)
    sought = measurement.seek(Step(-1, Position(15.0), cast("Any", frames[:1])))
    assert sought.contact.is_firm == is_firm
    assert measured == [(10, True)], "no weak contact is searched for"
    measurement.seek(Step(0, Position(15.0), cast("Any", frames)))
    assert measured[1:] == [(level, False) for level in again], "each frame once, then their mean"
    measured.clear()
    measurement.measure(Step(-1, Position(15.0), cast("Any", frames[:1])))
    measurement.measure(Step(0, Position(15.0), cast("Any", frames)))
    assert [level for level, _ in measured] == [10, *again], "likewise where the whole frame is measured at once"
