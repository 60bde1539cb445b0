"""The inspector's actions on devices that only record the requests to them."""

import asyncio
from collections import defaultdict
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from station.devices.camera.interface import Frame
from station.devices.gripper.errors import GripperTimeoutError
from station.devices.gripper.interface import GripperReading, MoveResult, ObjectState
from station.inspection.cycle import PLACING, TABLE, Event
from station.inspection.second_press import FREED_BY_MM
from station.inspection.states import State
from station.press.motion import Met
from station.press.rig import GripError, Position
from station.runtime.cycle import actions
from station.runtime.cycle.actions import Inspector
from station.runtime.cycle.runner import event_of
from station.settings.recipe import find_recipe
from station.vocabulary import Reason

OPEN_MM = 53.0
FREED_MM = 45.0


class Jaws:
    """A gripper that is where it was sent, or does not move at all."""

    max_width_mm = OPEN_MM

    def __init__(self, width_mm: float, *, moves: bool = True, state: ObjectState = ObjectState.AT_POSITION) -> None:
        self.width_mm, self.opened_to_mm = width_mm, list[float]()
        self.opened = asyncio.Event()
        self._moves, self._state = moves, state

    async def read(self) -> GripperReading:
        return GripperReading(self.width_mm, 0, self._state, True, 0, None, 0.0)

    async def open(self, width_mm: float | None = None) -> MoveResult:
        to_mm = self.max_width_mm if width_mm is None else width_mm
        self.opened_to_mm.append(to_mm)
        self.opened.set()
        self.width_mm = to_mm if self._moves else self.width_mm
        return MoveResult(to_mm, await self.read())


class Camera:
    """A camera that always has a newer frame."""

    async def frame(self, newer_than_s: float, _deadline_s: float) -> Frame:
        return Frame(np.zeros((2, 2, 3), np.uint8), 1, newer_than_s + 0.03)


class Vision:
    """A measurement of one contact, that waits for something first."""

    def __init__(self, wait_for: asyncio.Event) -> None:
        self._wait_for = wait_for

    def measure_ahead(self, _frame: Frame) -> None: ...

    async def measure(self, step: Any) -> Any:
        await self._wait_for.wait()
        return SimpleNamespace(step=step, image=step.image, contact=SimpleNamespace(centroid_px=(0.5, 0.5)))


def inspector(jaws: Jaws) -> Inspector:
    cell = SimpleNamespace(camera=Camera(), gripper=jaws, arm=None)
    monitors = defaultdict(lambda: SimpleNamespace(report_success=lambda: None))
    devices = SimpleNamespace(cell=cell, monitors=monitors)
    configuration = SimpleNamespace(service=SimpleNamespace(patience=1.0), arm=None)
    metrics = SimpleNamespace(frame=lambda _fault: None)
    made = (devices, Vision(jaws.opened), configuration, None, metrics)
    return Inspector(*cast("tuple[Any, Any, Any, Any, Any]", made))


def inspection() -> Any:
    now = SimpleNamespace(active=SimpleNamespace(recipe=find_recipe("blueberry")), closings=0, mm_per_px=0.03)
    now.reasons = list[Reason]()
    now.interrupt = lambda reason, _why: now.reasons.append(reason)
    return now


def test_jaws_that_are_open_are_not_sent_open_again():
    jaws = Jaws(OPEN_MM)
    assert asyncio.run(inspector(jaws).check_jaws(inspection())) is Event.JAWS_OPEN
    assert jaws.opened_to_mm == []


@pytest.mark.parametrize(
    ("width_mm", "state"), [(30.0, ObjectState.AT_POSITION), (OPEN_MM - 1.0, ObjectState.CONTACT_OPENING)]
)
def test_jaws_that_are_not_open_or_stopped_by_something_are_opened_and_checked(width_mm, state):
    jaws, now = Jaws(width_mm, moves=False, state=state), inspection()
    assert asyncio.run(inspector(jaws).check_jaws(now)) is Event.REFERENCE_BAD
    assert jaws.opened_to_mm == [OPEN_MM]
    assert now.reasons == [Reason.REFERENCE_BAD]


def test_the_first_contact_is_measured_while_the_jaws_open():
    async def scenario():
        jaws = Jaws(14.0)
        worker, now = inspector(jaws), inspection()
        async with asyncio.timeout(10):
            opened, way = await worker._backed_off(now, worker._rig(now), Met(14.5, 15.0), Position(14.0))
        assert way is not None
        assert opened.width_mm == jaws.opened_to_mm[0] == pytest.approx(15.2)

    asyncio.run(scenario())


@pytest.mark.parametrize("release", ["let go", "open", "free", "rig"])
@pytest.mark.parametrize(
    ("width_mm", "state", "freed"),
    [
        (30.0, ObjectState.CONTACT_OPENING, False),
        (FREED_MM - 1.0, ObjectState.CONTACT_OPENING, True),
        (FREED_MM, ObjectState.AT_POSITION, True),
    ],
)
def test_jaws_that_something_stops_while_they_open_have_not_let_the_fruit_go(
    monkeypatch, release, width_mm, state, freed
):
    monkeypatch.setattr(actions, "_LET_GO_S", 0.0)
    monkeypatch.setattr(actions, "_LET_GO_AGAIN_S", 0.0)
    jaws, now = Jaws(width_mm, moves=False, state=state), inspection()
    jaws.max_width_mm, now.met_mm = FREED_MM, FREED_MM
    worker = inspector(jaws)
    releases = {
        "let go": lambda: worker._let_go(FREED_MM),
        "open": worker.open_jaws,
        "free": lambda: worker.free_fruit(now),
        "rig": lambda: worker._rig(now).release(),
    }
    if freed:
        asyncio.run(releases[release]())
        return
    with pytest.raises(GripError if release == "rig" else GripperTimeoutError):
        asyncio.run(releases[release]())
    assert len(jaws.opened_to_mm) == (2 if release == "let go" else 1), "to let go is tried again"


@pytest.mark.parametrize("opened_by_mm", [0.0, FREED_BY_MM - 0.5])
def test_jaws_that_are_stopped_where_they_met_the_fruit_have_not_freed_it(opened_by_mm):
    met_mm = OPEN_MM - 5.0
    jaws, now = Jaws(met_mm + opened_by_mm, moves=False, state=ObjectState.CONTACT_OPENING), inspection()
    now.met_mm = met_mm
    if opened_by_mm:
        asyncio.run(inspector(jaws).free_fruit(now))
        return
    with pytest.raises(GripperTimeoutError):
        asyncio.run(inspector(jaws).free_fruit(now))


def test_a_judged_fruit_that_was_not_surely_released_needs_a_person():
    jaws = Jaws(30.0, moves=False, state=ObjectState.CONTACT_OPENING)
    with pytest.raises(GripperTimeoutError) as blocked:
        asyncio.run(inspector(jaws).open_jaws())
    event = event_of(blocked.value)
    assert {TABLE[state, event].state for state in PLACING} == {State.CARRIED}
    assert TABLE[State.RELEASING, event].state is State.HELD
