"""Motions of a calibration at the panel: once the cycle is stopped, none but of jaws that may open."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.panel_maintenance import ContinueCalibrationRun, NoteGelChange, StartCalibrationRun
from station.devices.gripper.errors import GripperNotActiveError
from station.devices.gripper.interface import GripperReading, MoveResult, ObjectState
from station.errors import StationError
from station.inspection.states import STATES, State
from station.messages import gripper as gripper_messages
from station.messages.calibration import A_CALIBRATION
from station.messages.maintenance import BUSY, UNDER_WAY
from station.messages.operation import INTERNAL_FAULT
from station.press.rig import GripError
from station.runtime.devices.manager import DeviceManager
from station.runtime.devices.rig import Cell
from station.runtime.rpc.calibration import PanelCalibration, _Run
from station.settings.configuration import Configuration
from station.settings.recipe import find_recipe
from tests.runtime.ball import MAX

OPEN_MM = 53.0
PRESSED_MM = 40.0


class Devices:
    """A gripper without its activation and an arm in one, which record the requests to them."""

    max_width_mm, known_width_mm = OPEN_MM, None

    def __init__(self) -> None:
        self.moves: list[str] = []
        self.active, self.at = False, "home"

    def _reading(self, width_mm: float) -> GripperReading:
        return GripperReading(width_mm, 0, ObjectState.AT_POSITION, self.active, 0, None, time.monotonic())

    def _at(self, width_mm: float) -> MoveResult:
        return MoveResult(width_mm, self._reading(width_mm))

    async def read(self) -> GripperReading:
        return self._reading(PRESSED_MM)

    async def state(self) -> Any:
        return SimpleNamespace(at=self.at, fault=None)

    async def activate(self) -> None:
        self.moves.append("activate")
        self.active = True

    async def open(self, width_mm: float | None = None) -> MoveResult:
        self.moves.append("open")
        return self._at(OPEN_MM if width_mm is None else width_mm)

    async def move_to_width(self, width_mm: float, _speed_mm_s: float, _force_n: float) -> MoveResult:
        self.moves.append("close")
        return self._at(width_mm)

    async def move_to(self, pose: str) -> None:
        self.moves.append(pose)


class Service:
    """A cycle whose state is set by hand."""

    manual_activity = None

    def __init__(self) -> None:
        self.state, self.runner = State.IDLE, self

    @property
    def bound_for(self) -> State:
        return self.state


class Panel:
    """A panel's calibration over a cycle whose state is set by hand."""

    def __init__(self, home: Any) -> None:
        self.devices, self.service, self.work_refusal = Devices(), Service(), None
        camera: Any = SimpleNamespace(description=SimpleNamespace(serial="D1"))
        gripper_and_arm: Any = self.devices
        cell = Cell(camera, gripper_and_arm, gripper_and_arm)
        site: Any = SimpleNamespace(home=home, service=SimpleNamespace(patience=1.0))
        devices = DeviceManager(Configuration(home=home), lambda *_: None, lambda _: None)
        devices.cell, devices._arm = cell, gripper_and_arm
        production: Any = SimpleNamespace(service=self.service, devices=devices)
        maintenance: Any = SimpleNamespace(refusal=lambda: None, work_refusal=lambda: self.work_refusal)
        unused: Any = None
        self.calibration = PanelCalibration(site, production, unused, unused, unused, maintenance)
        self.run = _Run("calibration", MAX)
        self.rig = self.calibration._rig(self.run, find_recipe("rubber_ball"))


@pytest.fixture
def panel(tmp_path):
    return Panel(tmp_path)


@pytest.mark.parametrize("state", [State.IDLE, State.STOPPED])
def test_where_the_cycle_waits_a_run_moves_all(panel, state):
    async def scenario():
        panel.service.state = state
        await panel.rig.make_ready()
        await panel.rig.close_to(PRESSED_MM)
        await panel.rig.release()

    asyncio.run(scenario())
    assert panel.devices.moves == ["activate", "close", "open", "above_nest", "home"]


@pytest.mark.parametrize(
    ("state", "moves"),
    [(State.HELD, ["open"]), (State.LATCHED, []), (State.RECORDING_LATCHED, []), (State.RECOVERING, [])],
)
def test_where_the_cycle_was_stopped_a_run_moves_nothing_but_jaws_that_may_open(panel, state, moves):
    async def scenario():
        panel.service.state = state
        for motion in (
            panel.rig.make_ready(),
            panel.rig.close_to(PRESSED_MM),
            panel.rig.enter_nest(),
            panel.rig.leave_nest(),
        ):
            with pytest.raises(GripError) as refused:
                await motion
            assert refused.value.message == STATES[state].activity
        with pytest.raises(GripError):
            await panel.rig.release()

    asyncio.run(scenario())
    assert panel.devices.moves == moves


def test_a_gripper_that_may_have_the_ball_between_its_jaws_is_not_activated_and_nothing_moves(panel):
    panel.service.state, panel.devices.at = State.STOPPED, "nest"
    with pytest.raises(GripperNotActiveError) as refused:
        asyncio.run(panel.rig.make_ready())
    assert refused.value.cause == gripper_messages.JAWS_UNKNOWN()
    assert refused.value.remedy == gripper_messages.REMEDY_EMPTY_JAWS()
    assert panel.devices.moves == []


def test_an_arm_that_is_stopped_on_its_way_does_not_begin_the_next_part(panel, monkeypatch):
    async def stopped(pose):
        panel.devices.moves.append(pose)
        panel.service.state = State.LATCHED

    monkeypatch.setattr(panel.devices, "move_to", stopped)
    with pytest.raises(GripError):
        asyncio.run(panel.rig.leave_nest())
    assert panel.devices.moves == ["above_nest"]


def test_a_run_that_waits_for_the_ball_does_not_go_on_in_a_stop(panel):
    async def scenario():
        panel.run.state, panel.calibration._run = "waiting", panel.run
        panel.service.state = State.LATCHED
        with pytest.raises(StationError) as refused:
            await panel.calibration.go_on(ContinueCalibrationRun(actor=MAX))
        assert refused.value.message == STATES[State.LATCHED].activity
        assert panel.run.state == "waiting"
        panel.service.state = State.STOPPED
        await panel.calibration.go_on(ContinueCalibrationRun(actor=MAX))
        assert panel.run.laid.is_set()

    asyncio.run(scenario())


def test_no_run_begins_while_a_judged_fruit_may_be_between_the_jaws(panel):
    panel.service.state = State.CARRIED
    with pytest.raises(StationError) as refused:
        asyncio.run(panel.calibration.begin(StartCalibrationRun(kind="calibration", actor=MAX)))
    assert refused.value.message == STATES[State.CARRIED].activity
    assert panel.calibration._run is None


def test_no_change_of_the_gel_is_noted_in_an_inspection_or_a_run(panel):
    for panel.work_refusal, panel.service.manual_activity, why in (
        (BUSY(), None, BUSY()),
        (None, A_CALIBRATION(), UNDER_WAY(activity=A_CALIBRATION())),
    ):
        with pytest.raises(StationError) as refused:
            asyncio.run(panel.calibration.note_gel_change(NoteGelChange(actor=MAX)))
        assert refused.value.message == why


def test_a_change_of_the_gel_is_noted_also_with_the_cell_made_safe(panel):
    panel.service.state = State.LATCHED
    assert panel.calibration._run_refusal("D1") == STATES[State.LATCHED].activity
    assert panel.calibration._gel_change_refusal("D1") is None


def test_a_run_that_a_bug_ends_has_failed(panel, monkeypatch):
    async def fails(_run, _request):
        raise RuntimeError("a bug")

    monkeypatch.setattr(panel.calibration, "_calibrate", fails)
    asyncio.run(panel.calibration._run_procedure(panel.run, StartCalibrationRun(kind="calibration", actor=MAX)))
    assert (panel.run.state, panel.run.result) == ("failed", INTERNAL_FAULT(words="RuntimeError: a bug"))
