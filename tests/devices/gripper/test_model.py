"""The register model on a clock that runs ahead."""

from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from station.twin.faults import CommonFault, FaultBoard
from station.twin.robotiq.faults import Code, GripperFault, gripper_faults
from station.twin.robotiq.load import Load, Spring
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.registers import Command
from tests.manual_clock import ManualClock

CLOSE = Command(activate=True, go_to=True, position=255)
OPEN = Command(activate=True, go_to=True, position=0)


class Twin:
    """A gripper, its clock and its faults."""

    def __init__(self, load: Load | None = None) -> None:
        self.clock = ManualClock()
        self.faults: FaultBoard = gripper_faults()
        self.gripper = RobotiqGripper(self.clock, self.faults)
        self.gripper.write(Command(activate=True))
        self.after(2.0)
        if load:
            self.gripper.load = load

    def after(self, duration_s: float):
        self.clock.advance(duration_s)
        return self.gripper.status()

    @property
    def opening_mm(self) -> float:
        return self.gripper.opening_mm(self.clock.now_s())


@pytest.fixture
def twin() -> Twin:
    return Twin()


def test_activation_closes_and_opens_the_fingers_before_it_is_done():
    clock = ManualClock()
    gripper = RobotiqGripper(clock, gripper_faults())
    assert gripper.status().state == 0
    gripper.write(Command(activate=True))
    clock.advance(85 / 150)
    assert gripper.opening_mm(clock.now_s()) == pytest.approx(0.0)
    assert gripper.status().state == 1
    clock.advance(85 / 150 + 0.001)
    assert gripper.status().state == 3
    assert gripper.opening_mm(clock.now_s()) == pytest.approx(85.0)


@pytest.mark.parametrize(("setting", "speed_mm_s"), [(0, 20.0), (255, 150.0), (128, 85.25)])
def test_the_fingers_travel_at_the_speed_that_is_set(twin: Twin, setting: int, speed_mm_s: float):
    twin.gripper.write(replace(CLOSE, speed=setting))
    twin.after(0.3)
    assert 85.0 - twin.opening_mm == pytest.approx(0.3 * speed_mm_s, abs=0.1)


def test_fingers_read_3_open_and_230_closed(twin: Twin):
    assert twin.after(0.0).position == 3
    twin.gripper.write(CLOSE)
    status = twin.after(10.0)
    assert (status.position, status.echo, status.object_) == (230, 255, 3)


def test_the_object_state_is_cleared_before_a_command_is_acknowledged(twin: Twin):
    twin.gripper.write(OPEN)
    assert twin.after(1.0).object_ == 3
    twin.gripper.write(CLOSE)
    assert twin.gripper.status().object_ == 0


def test_the_fingers_stop_where_the_load_reaches_the_grip_force():
    twin = Twin(Spring(free_mm=70.0, stiffness_n_per_mm=2.0))
    twin.gripper.write(CLOSE)
    status = twin.after(10.0)
    assert status.object_ == 2
    assert twin.opening_mm == pytest.approx(70.0 - 20.0 / 2.0, abs=0.01)
    twin.gripper.write(replace(CLOSE, force=255))
    assert twin.after(10.0).object_ == 3
    assert twin.opening_mm == 0.0


def test_something_outside_the_fingers_stops_them_while_opening(twin: Twin):
    twin.gripper.write(CLOSE)
    twin.after(10.0)

    class Ring:
        def force_N(self, opening_mm: float) -> float:  # noqa: N802
            return -30.0 if opening_mm >= 40.0 else 0.0

    twin.gripper.load = Ring()
    twin.gripper.write(OPEN)
    assert twin.after(10.0).object_ == 1
    assert twin.opening_mm == pytest.approx(40.0, abs=0.01)


def test_a_dropped_object_reads_as_at_position_while_the_fingers_go_on():
    twin = Twin(Spring(free_mm=60.0, stiffness_n_per_mm=5.0))
    twin.gripper.write(CLOSE)
    assert twin.after(10.0).object_ == 2
    held_mm = twin.opening_mm
    twin.faults.set(GripperFault.OBJECT_DROPPED)
    status = twin.after(0.1)
    assert status.object_ == 3
    assert 0.0 < twin.opening_mm < held_mm
    assert twin.after(10.0).position == 230


def test_a_load_that_creeps_is_followed_without_losing_it():
    load = Spring(free_mm=60.0, stiffness_n_per_mm=5.0)
    twin = Twin(load)
    twin.gripper.write(CLOSE)
    twin.after(10.0)
    held_mm = twin.opening_mm
    load.free_mm -= 1.0
    assert twin.after(0.01).object_ == 2
    assert twin.after(1.0).object_ == 2
    assert held_mm - twin.opening_mm == pytest.approx(1.0, abs=0.01)


def test_current_is_drawn_while_moving_and_more_under_load():
    twin = Twin(Spring(free_mm=85.0, stiffness_n_per_mm=0.2))
    twin.gripper.write(CLOSE)
    free, pressed = twin.after(0.05), twin.after(2.0)
    assert 10 <= free.current < pressed.current
    assert twin.after(10.0).current == 0


@given(st.lists(st.floats(0.001, 0.5), max_size=12), st.floats(5.0, 80.0), st.floats(0.5, 50.0))
@example([0.29651618690593334, 0.29651618690593334, 0.5], 40.0, 0.5)
def test_where_the_fingers_stop_does_not_depend_on_how_often_one_looks(
    waits_s: list[float], free_mm: float, stiffness: float
):
    watched, alone = Twin(Spring(free_mm, stiffness)), Twin(Spring(free_mm, stiffness))
    for twin in (watched, alone):
        twin.gripper.write(CLOSE)
    for wait_s in waits_s:
        watched.after(wait_s)
    assert watched.after(10.0).object_ == alone.after(10.0 + sum(waits_s)).object_
    assert watched.opening_mm == pytest.approx(alone.opening_mm, abs=0.005)


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (GripperFault.UNDER_VOLTAGE, Code.UNDER_VOLTAGE),
        (GripperFault.INTERNAL_FAULT, Code.INTERNAL),
        (GripperFault.OVERCURRENT, Code.OVERCURRENT),
    ],
)
def test_a_major_fault_stays_until_reset_and_activation(twin: Twin, fault: str, code: int):
    twin.gripper.write(CLOSE)
    twin.after(0.1)
    twin.faults.set(fault)
    status = twin.after(0.01)
    stopped_mm = twin.opening_mm
    assert (status.fault, status.state) == (code, 0)
    twin.faults.clear()
    assert twin.after(1.0).fault == code
    assert twin.opening_mm == stopped_mm
    twin.gripper.write(Command())
    twin.gripper.write(Command(activate=True))
    status = twin.after(3.0)
    assert (status.fault, status.state) == (0, 3)


@pytest.mark.parametrize(("opens", "end_mm"), [(True, 85.0), (False, 0.0)])
def test_an_automatic_release_goes_slowly_to_its_end(twin: Twin, opens: bool, end_mm: float):
    twin.gripper.write(replace(CLOSE, position=116))
    twin.after(5.0)
    started_mm = twin.opening_mm
    twin.gripper.write(replace(CLOSE, position=116, release=True, release_opens=opens))
    assert twin.after(0.5).fault == Code.RELEASING
    assert abs(twin.opening_mm - started_mm) == pytest.approx(10.0, abs=0.1)
    assert twin.after(10.0).fault == Code.RELEASED
    assert twin.opening_mm == end_mm


def test_a_hot_gripper_waits_and_an_activation_fault_ends_the_activation(twin: Twin):
    twin.faults.set(GripperFault.OVER_TEMPERATURE)
    twin.gripper.write(CLOSE)
    assert twin.after(1.0).fault == Code.OVER_TEMPERATURE
    assert twin.opening_mm == 85.0
    twin.faults.clear()
    twin.faults.set(GripperFault.ACTIVATION_FAULT)
    twin.gripper.write(Command())
    twin.gripper.write(Command(activate=True))
    status = twin.after(10.0)
    assert (status.fault, status.state) == (Code.ACTIVATION, 0)


def test_a_motion_asked_for_too_early_is_a_fault():
    gripper = RobotiqGripper(ManualClock(), gripper_faults())
    gripper.write(Command(go_to=True))
    assert gripper.status().fault == Code.ACTIVATION_BIT
    gripper.write(Command(go_to=True, activate=True))
    assert gripper.status().fault == Code.ACTIVATE_FIRST


def test_an_emergency_stop_ends_the_motion_for_good(twin: Twin):
    twin.gripper.write(CLOSE)
    twin.after(0.1)
    twin.faults.set(GripperFault.EMERGENCY_STOPPED)
    twin.after(0.1)
    stopped_mm = twin.opening_mm
    twin.faults.clear()
    twin.after(5.0)
    assert twin.opening_mm == stopped_mm


def test_stuck_slow_and_wrong(twin: Twin):
    twin.faults.set(CommonFault.STUCK)
    before = twin.after(0.0)
    twin.gripper.write(CLOSE)
    assert twin.after(1.0) == before
    twin.faults.clear()
    twin.faults.set(CommonFault.SLOW, 3.0)
    twin.gripper.write(replace(CLOSE, speed=255))
    twin.after(0.4)
    assert 85.0 - twin.opening_mm == pytest.approx(150 / 4 * 0.4, abs=0.1)
    twin.faults.clear()
    right = twin.after(0.0)
    twin.faults.set(CommonFault.WRONG, 7)
    wrong = twin.after(0.0)
    assert (wrong.position - right.position, (wrong.echo - right.echo) % 256) == (7, 7)


class Registers(RuleBasedStateMachine):
    """With any writes of a master and any events, the registers stay what the manual allows."""

    @initialize()
    def begin(self):
        self.clock = ManualClock()
        self.faults = gripper_faults()
        self.load = Spring(free_mm=50.0, stiffness_n_per_mm=4.0)
        self.gripper = RobotiqGripper(self.clock, self.faults, self.load)
        self.seen_mm = 85.0

    @rule(words=st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=3), offset=st.integers(0, 2))
    def write(self, words: list[int], offset: int):
        self.gripper.write_registers(0x03E8 + offset, words[: 3 - offset])

    @rule()
    def activate(self):
        self.gripper.write_registers(0x03E8, [0x0000])
        self.gripper.write_registers(0x03E8, [0x0100])

    @rule(position=st.integers(0, 255), speed=st.integers(0, 255), force=st.integers(0, 255))
    def go_to(self, position: int, speed: int, force: int):
        before = self.gripper.command
        self.gripper.write_registers(0x03E8, [0x0900, position, speed << 8 | force])
        if self.gripper.command != before:
            assert self.gripper.status().object_ == 0

    @rule(duration_s=st.floats(0.0, 5.0))
    def wait(self, duration_s: float):
        before_mm = self.gripper.opening_mm(self.clock.now_s())
        self.clock.advance(duration_s)
        after_mm = self.gripper.opening_mm(self.clock.now_s())
        assert abs(after_mm - before_mm) <= 150.0 * duration_s + 1e-6

    @rule(free_mm=st.floats(0.0, 85.0))
    def fruit(self, free_mm: float):
        self.load.free_mm = free_mm

    @rule(fault=st.sampled_from(gripper_faults().known))
    def fail(self, fault: str):
        self.faults.set(fault)

    @rule()
    def mend(self):
        self.faults.clear()

    @invariant()
    def registers_are_lawful(self):
        status = self.gripper.status()
        assert status.state in {0, 1, 3}
        assert status.fault in set(Code)
        assert 0.0 <= self.gripper.opening_mm(self.clock.now_s()) <= 85.0
        assert all(0 <= word <= 0xFFFF for word in status.words())
        if not self.faults.active("wrong"):
            assert 3 <= status.position <= 230 or (status.position == 0 and status.state != 3), (
                "0 is after a loss of power"
            )
            assert status.echo == self.gripper.command.position
        if status.state == 3 and not status.go_to:
            assert status.current == 0
        if status.object_ == 2 and not self.faults.active("object_dropped"):
            assert status.go_to


Registers.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
TestRegisters = Registers.TestCase


@pytest.mark.parametrize("amount", [-1.0, -2.0, 1e300, float("inf"), float("nan")])
@pytest.mark.parametrize("fault", [CommonFault.SLOW, CommonFault.WRONG])
def test_no_amount_stops_the_model(twin: Twin, monkeypatch: pytest.MonkeyPatch, fault: CommonFault, amount: float):
    with monkeypatch.context() as mad:
        mad.setattr(twin.faults, "amount", lambda one: amount if one == fault else 0.0)
        twin.gripper.write(CLOSE)
        twin.after(1.0)
    assert twin.after(10.0).position == 230
