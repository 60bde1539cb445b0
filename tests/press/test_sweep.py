"""The sweep to a fruit: closing without a stop, the fingers' width at each frame, and how far they go unseen."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from station.devices.camera.interface import Frame
from station.devices.gripper.errors import GripperStoppedError
from station.devices.gripper.interface import GripperReading, MoveResult, ObjectState
from station.messages import gripper as gripper_messages
from station.press import motion
from station.press.motion import Met, close_on, sweep
from station.press.procedure import back_off, onset, onset_again
from station.press.stop import MOST_UNSEEN_MM, NothingTouchedError, UnseenContactError
from station.runtime.devices import rig as rig_module
from station.runtime.devices.rig import Cell, DeviceRig
from station.settings.recipe import find_recipe

BLUEBERRY = find_recipe("blueberry")
START_MM = BLUEBERRY.expected_width.largest_mm
FRAME_S, FRAME_AGE_S = 1 / 30, 0.05


class Fingers:
    """A gripper and a camera on one clock, which goes on by a frame with every frame."""

    max_width_mm = 53.0

    def __init__(self, fruit_mm: float, stopped_at_mm: float = 0.0) -> None:
        self.now_s, self.fruit_mm, self.stopped_at_mm = 100.0, fruit_mm, stopped_at_mm
        self.stops, self.opened_to_mm = 0, []
        self.answers_in_s = 0.0
        self._from, self._to_mm, self._speed = (self.now_s, START_MM), START_MM, 0.0
        self._stopped, self._ticked = asyncio.Event(), asyncio.Event()

    def width_at(self, at_s: float) -> float:
        since_s, from_mm = self._from
        way = self._speed * max(0.0, at_s - since_s)
        return max(from_mm - way, self._to_mm, self.stopped_at_mm) if self._to_mm < from_mm else self._to_mm

    async def read(self) -> GripperReading:
        requested_s, self.now_s = self.now_s, self.now_s + self.answers_in_s
        width_mm = self.width_at(self.now_s)
        held = self.stopped_at_mm > self._to_mm and width_mm <= self.stopped_at_mm
        state = ObjectState.CONTACT_CLOSING if held else ObjectState.AT_POSITION
        return GripperReading(width_mm, 0, state, active=True, fault_code=0, current_a=None, at_s=requested_s)

    async def move_to_width(self, width_mm: float, speed_mm_s: float, _force_n: float) -> MoveResult:
        self._stopped.clear()
        self._from, self._to_mm, self._speed = (self.now_s, self.width_at(self.now_s)), width_mm, speed_mm_s
        if self._from[1] - width_mm <= 2.0:  # a step is there before the next frame
            self._from = (0.0, self._from[1])
        while self.width_at(self.now_s) > max(width_mm, self.stopped_at_mm):
            self._ticked.clear()
            await self._ticked.wait()
            if self._stopped.is_set():
                raise GripperStoppedError(gripper_messages.STOPPED(), gripper_messages.REMEDY_STOPPED())
        return MoveResult(width_mm, await self.read())

    async def open(self, width_mm: float | None = None) -> MoveResult:
        self._from, self._to_mm = (self.now_s, width_mm or self.max_width_mm), width_mm or self.max_width_mm
        self.opened_to_mm.append(self._to_mm)
        return MoveResult(self._to_mm, await self.read())

    async def stop(self) -> GripperReading:
        self.stops += 1
        self._to_mm = self.width_at(self.now_s)
        self._from = (self.now_s, self._to_mm)
        self._stopped.set()
        self._ticked.set()
        return await self.read()

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        captured_s = newer_than_s + FRAME_S
        self.now_s = max(self.now_s + FRAME_S, captured_s + FRAME_AGE_S)
        self._ticked.set()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        return Frame(np.zeros((2, 2, 3), np.uint8), 1, captured_s)


@pytest.fixture
def cell(monkeypatch):
    def make(fruit_mm: float, stopped_at_mm: float = 0.0) -> tuple[Fingers, DeviceRig, Any]:
        fingers = Fingers(fruit_mm, stopped_at_mm)

        class Clock:
            @staticmethod
            def monotonic() -> float:
                return fingers.now_s

        monkeypatch.setattr(motion, "time", Clock)
        monkeypatch.setattr(rig_module, "time", Clock)

        async def measure(step: Any) -> Any:
            touched = fingers.width_at(step.last_frame.captured_s) < fruit_mm
            return SimpleNamespace(step=step, contact=SimpleNamespace(is_firm=touched))

        return fingers, DeviceRig(Cell(cast("Any", fingers), cast("Any", fingers), None), BLUEBERRY), measure

    return make


def test_the_fingers_close_on_until_a_frame_shows_a_contact_and_each_frame_has_its_own_width(cell):
    async def scenario():
        fingers, rig, measure = cell(15.3)
        met = await sweep(rig, BLUEBERRY, measure)
        stopped_mm = (await fingers.read()).width_mm
        assert fingers.stops == 1
        assert met.clear_mm is not None
        assert met.width_mm < 15.3 <= met.clear_mm
        assert met.clear_mm - met.width_mm == pytest.approx(BLUEBERRY.gripper.speed_mm_s * FRAME_S, abs=0.01)
        assert 15.3 - stopped_mm < MOST_UNSEEN_MM
        before, start = await onset(rig, BLUEBERRY, await back_off(rig, met), measure)
        assert min(fingers.opened_to_mm) > 15.3, "the fine search begins where nothing touches"
        assert before is not None
        assert before.move.width_mm >= 15.3 > start.step.move.width_mm
        assert before.move.width_mm - start.step.move.width_mm == pytest.approx(0.4)

    asyncio.run(scenario())


@pytest.mark.parametrize(("fruit_mm", "sweeps"), [(17.3, 0), (17.9, 0), (16.5, 0), (14.0, 1)])
def test_a_fruit_that_was_met_before_is_searched_from_beside_it_and_swept_for_where_it_has_gone(cell, fruit_mm, sweeps):
    async def scenario():
        fingers, rig, measure = cell(fruit_mm)
        await fingers.open(19.3)
        before, start = await onset_again(rig, BLUEBERRY, Met(17.1, 17.5), measure)
        assert fingers.stops == sweeps
        assert before is not None
        assert before.move.width_mm >= fruit_mm > start.step.move.width_mm
        assert before.move.width_mm - start.step.move.width_mm == pytest.approx(0.4)

    asyncio.run(scenario())


def test_a_fruit_that_was_met_before_and_is_gone_is_not_touched(cell):
    async def scenario():
        fingers, rig, measure = cell(0.0)
        await fingers.open(19.3)
        with pytest.raises(NothingTouchedError):
            await onset_again(rig, BLUEBERRY, Met(17.1, 17.5), measure)

    asyncio.run(scenario())


def test_the_fingers_close_while_the_first_frame_comes_and_stop_where_it_shows_that_something_touches_already(cell):
    async def scenario():
        fingers, rig, measure = cell(START_MM + 1.0)
        met = await sweep(rig, BLUEBERRY, measure)
        way_mm = BLUEBERRY.gripper.speed_mm_s * FRAME_S
        assert met == (pytest.approx(START_MM - way_mm, abs=0.01), None)
        assert START_MM - (await fingers.read()).width_mm < MOST_UNSEEN_MM
        assert fingers.stops == 1

    asyncio.run(scenario())


def test_fingers_wait_for_a_measurement_that_is_late(cell, monkeypatch):
    async def scenario():
        fingers, rig, measure = cell(15.3)
        monkeypatch.setattr(motion, "time", time)
        monkeypatch.setattr(rig_module, "time", time)
        fingers.now_s = time.monotonic()
        frames = 0

        async def late(step: Any) -> Any:
            nonlocal frames
            frames += 1
            before = fingers.stops
            while frames == 3 and fingers.stops == before:
                await asyncio.sleep(0.01)
            return await measure(step)

        met = await sweep(rig, BLUEBERRY, late)
        assert fingers.width_at(fingers.now_s + 10) == fingers.width_at(fingers.now_s), "they stand at the contact"
        assert met.width_mm < 15.3

    asyncio.run(scenario())


def test_fingers_get_on_where_every_measurement_is_late(cell):
    async def scenario():
        fingers, rig, _ = cell(14.0)
        camera, measured = fingers.frame, 0

        async def frame(newer_than_s: float, deadline_s: float) -> Frame:
            for _ in range(5):  # it comes after the move has started, and after a stop for which nothing is waited
                await asyncio.sleep(0)
            return await camera(newer_than_s, deadline_s)

        async def late(step: Any) -> Any:
            nonlocal measured
            measured += 1
            assert measured < 200, f"the fingers are at {fingers.width_at(fingers.now_s)} mm"
            fingers.now_s += 0.2
            await asyncio.sleep(0)
            return cast("Any", SimpleNamespace(step=step, contact=SimpleNamespace(is_firm=step.move.width_mm < 14.0)))

        fingers.frame = frame
        met = await sweep(rig, BLUEBERRY, late)
        assert met.width_mm < 14.0

    asyncio.run(scenario())


@pytest.mark.parametrize(("stopped_at_mm", "error"), [(14.0, UnseenContactError), (0.0, NothingTouchedError)])
def test_fingers_that_end_their_way_without_a_contact_say_whether_something_held_them(cell, stopped_at_mm, error):
    async def scenario():
        _, rig, measure = cell(0.0, stopped_at_mm)
        with pytest.raises(error):
            await sweep(rig, BLUEBERRY, measure)

    asyncio.run(scenario())


def test_frames_on_the_way_wait_for_a_measurement_that_is_late(cell):
    async def scenario():
        fingers, rig, _ = cell(15.3)
        await fingers.open(16.0)
        widths_mm = []

        async def measured(step: Any) -> bool:
            while fingers.width_at(fingers.now_s) > 13.0:
                await asyncio.sleep(0)
            widths_mm.append(step.move.width_mm)
            return True

        async with asyncio.timeout(10):
            assert (await close_on(rig, BLUEBERRY, 13.0, measured)).width_mm == 13.0
        way_mm = BLUEBERRY.gripper.speed_mm_s * FRAME_S
        assert -np.diff(widths_mm) == pytest.approx([way_mm] * 3, abs=0.01), "every frame, each with its own width"

    asyncio.run(scenario())


def test_an_area_that_ends_the_steps_stops_the_fingers_on_their_way(cell):
    async def scenario():
        fingers, rig, _ = cell(15.3)
        await fingers.open(16.0)
        stopped = await close_on(rig, BLUEBERRY, 10.0, lambda step: asyncio.sleep(0, step.move.width_mm > 14.5))
        assert fingers.stops == 1
        assert 10.0 < stopped.width_mm < 14.5

    asyncio.run(scenario())


@pytest.mark.parametrize(("answers_in_s", "known"), [(0.02, True), (0.06, False)])
def test_a_frame_whose_width_is_not_known_to_a_count_is_no_step(cell, answers_in_s, known):
    async def scenario():
        fingers, rig, _ = cell(15.3)
        fingers.answers_in_s = answers_in_s
        await fingers.open(16.0)
        steps = []

        async def measured(step: Any) -> bool:
            steps.append(step)
            return True

        await close_on(rig, BLUEBERRY, 10.0, measured)
        assert bool(steps) == known
        for step in steps:
            assert step.move.width_mm == pytest.approx(fingers.width_at(step.last_frame.captured_s), abs=0.4)

    asyncio.run(scenario())
