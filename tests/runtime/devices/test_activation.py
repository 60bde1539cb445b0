"""When a gripper that lost its activation is activated by itself, when a person is needed, and what is reported."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from station.devices.arm.arm import ArmState
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperFaultError, GripperNotActiveError, GripperTimeoutError
from station.devices.gripper.interface import GripperReading, ObjectState
from station.messages import gripper as gripper_messages
from station.messages.message import verbatim
from station.runtime.devices.manager import ARM, GRIPPER, DeviceManager
from station.runtime.devices.rig import Cell
from station.settings.arm import PoseName
from station.settings.configuration import Configuration

EMPTY_THE_JAWS = GripperNotActiveError(gripper_messages.JAWS_UNKNOWN(), gripper_messages.REMEDY_EMPTY_JAWS())
WAIT = GripperNotActiveError(gripper_messages.NOT_ACTIVE(), gripper_messages.REMEDY_WAIT())
OVER_TEMPERATURE = 0x8
AROUND_A_FRUIT_MM = 20.0
OPEN_MM = 54.0


@dataclass
class Gripper:
    """A gripper with its fingers around a fruit, or as wide as it is set to."""

    active: bool = True
    fault_code: int = 0
    activations: int = 0
    max_width_mm: float = 53.0
    fails: Exception | None = None
    known_width_mm: float | None = None
    width_mm: float = AROUND_A_FRUIT_MM

    async def read(self):
        state, now_s = ObjectState.IDLE, time.monotonic()
        return GripperReading(self.width_mm, 120, state, self.active, self.fault_code, None, now_s)

    async def activate(self):
        self.activations += 1
        if self.fails is not None:
            raise self.fails
        self.active, self.fault_code = True, 0


@dataclass
class Arm:
    at: PoseName | None = "nest"
    fault: ArmFault | None = None

    async def state(self):
        return ArmState(0.01, (0.0,) * 6, moving=False, at=self.at, fault=self.fault)

    async def move_to(self, pose):
        self.at = pose


@dataclass
class Bench:
    """A device manager with a gripper and an arm at the nest, each checked by hand."""

    devices: DeviceManager
    gripper: Gripper
    arm: Arm
    may: Callable[[], bool] = lambda: True

    async def check(self, name=GRIPPER):
        """Check a device as its monitor does; its fault from now on."""
        monitor = self.devices.monitors[name]
        checking = asyncio.create_task(monitor.run())
        heard = asyncio.Event()
        monitor._on_progress = heard.set
        await heard.wait()
        checking.cancel()
        await asyncio.gather(checking, return_exceptions=True)
        return monitor.fault

    async def activate(self):
        """Activate as housekeeping does; why it was not done."""
        try:
            await self.devices.activate_if_safe(self.may)
        except Exception as error:  # noqa: BLE001 (the test names it)
            return error
        return None


@pytest.fixture
def bench(tmp_path):
    devices = DeviceManager(Configuration(home=tmp_path), lambda *_: None, lambda _: None)
    gripper: Any = Gripper()
    arm: Any = Arm()
    devices.cell, devices._arm = Cell(devices.cell.camera, gripper, arm), arm
    return Bench(devices, gripper, arm)


@pytest.mark.parametrize("used", ["checked", "inspected", "activated in vain"])
def test_a_confirmation_of_empty_jaws_ends_with_a_gripper_that_can_close_on_a_fruit(bench, used):
    async def scenario():
        bench.devices.confirm_clear()
        match used:
            case "checked":
                assert await bench.check() is None
            case "inspected":
                bench.devices.use(by_inspection=True)
                bench.devices.use(by_inspection=False)
            case _:
                assert await bench.activate() is None
        bench.gripper.active = False
        refused = await bench.activate()
        assert str(refused) == str(EMPTY_THE_JAWS)
        assert str(await bench.check()) == str(EMPTY_THE_JAWS)
        assert bench.gripper.activations == 0

        bench.devices.confirm_clear()
        assert await bench.activate() is None
        assert await bench.check() is None
        assert bench.gripper.activations == 1

    asyncio.run(scenario())


def test_a_confirmation_of_empty_jaws_ends_with_what_withdraws_the_reset(bench):
    async def scenario():
        bench.gripper.active = False
        bench.devices.confirm_clear()
        await bench.devices.end_recovery()
        assert str(await bench.activate()) == str(EMPTY_THE_JAWS)
        assert bench.gripper.activations == 0

    asyncio.run(scenario())


@pytest.mark.parametrize(("active", "fault_code"), [(False, 0), (True, 0xC), (False, 0xC)])
def test_a_confirmation_remains_while_the_gripper_waits_for_its_activation(bench, active, fault_code):
    async def scenario():
        bench.gripper.active, bench.gripper.fault_code = active, fault_code
        bench.devices.confirm_clear()
        assert await bench.check() is not None
        assert await bench.activate() is None
        assert bench.gripper.activations == 1

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("known_width_mm", "at", "activations"),
    [(None, "nest", 0), (AROUND_A_FRUIT_MM, "nest", 0), (OPEN_MM, "above_nest", 1)],
)
def test_at_the_nest_only_a_width_of_before_the_loss_of_activation_is_believed(bench, known_width_mm, at, activations):
    async def scenario():
        bench.gripper.active, bench.gripper.width_mm = False, OPEN_MM
        bench.gripper.known_width_mm = known_width_mm
        refused = await bench.activate()
        assert (refused and str(refused)) == (None if activations else str(EMPTY_THE_JAWS))
        assert (bench.arm.at, bench.gripper.activations) == (at, activations)

    asyncio.run(scenario())


@pytest.mark.parametrize("cause", [ArmCause.STALE, ArmCause.PROTECTIVE_STOP])
def test_a_fault_of_the_arm_that_is_over_is_not_the_grippers(bench, cause):
    async def scenario():
        bench.gripper.active, bench.arm.at = False, "home"
        bench.arm.fault = ArmFault(cause, verbatim("the arm's own"))
        assert isinstance(await bench.activate(), ArmFault)
        assert str(await bench.check()) == str(WAIT)
        bench.arm.fault = None
        assert await bench.check(ARM) is None
        assert str(await bench.check()) == str(WAIT)
        assert bench.devices.active_stop is None, "which refuses every reset"
        assert await bench.activate() is None
        assert await bench.check() is None

    asyncio.run(scenario())


def test_a_gripper_that_was_activated_on_the_pendant_forgets_why_the_station_did_not(bench):
    async def scenario():
        bench.gripper.active = False
        assert str(await bench.activate()) == str(EMPTY_THE_JAWS)
        assert str(await bench.check()) == str(EMPTY_THE_JAWS)
        bench.gripper.active = True
        assert await bench.check() is None
        bench.gripper.fault_code = OVER_TEMPERATURE
        assert str(await bench.check()) == str(GripperFaultError(OVER_TEMPERATURE))
        bench.gripper.active, bench.gripper.fault_code = False, 0
        assert str(await bench.check()) == str(WAIT)

    asyncio.run(scenario())


def test_an_activation_that_came_to_no_end_is_reported_and_tried_again(bench):
    async def scenario():
        bench.gripper.active, bench.arm.at = False, "home"
        bench.gripper.fails = late = GripperTimeoutError(verbatim("it came to no end"), verbatim("look for a cable"))
        assert await bench.activate() is late
        reported = await bench.check()
        assert str(reported) == str(late)
        assert isinstance(reported, GripperNotActiveError), "as which housekeeping tries it again"
        bench.gripper.fails = None
        assert await bench.activate() is None
        assert await bench.check() is None

    asyncio.run(scenario())


@pytest.mark.parametrize(("stopped_at", "ends_at"), [("nest", "nest"), ("above_nest", "above_nest")])
def test_nothing_moves_any_more_once_the_station_may_not_make_itself_ready(bench, stopped_at, ends_at):
    """At the nest the stop comes before anything has moved, above it while the arm leaves the nest."""

    async def scenario():
        bench.gripper.active, bench.gripper.known_width_mm = False, OPEN_MM
        bench.may = lambda: bench.arm.at != stopped_at
        assert await bench.activate() is None
        assert (bench.arm.at, bench.gripper.activations) == (ends_at, 0)

        bench.may = lambda: True
        assert await bench.activate() is None
        assert (bench.arm.at, bench.gripper.activations) == ("above_nest", 1)

    asyncio.run(scenario())


def test_the_end_of_a_recovery_stops_the_gripper_and_waits_for_fingers_that_travel_already(bench, monkeypatch):
    async def scenario():
        travelling, arrived, ended, stops = asyncio.Event(), asyncio.Event(), list[str](), list[str]()

        async def travel():
            travelling.set()
            await arrived.wait()
            ended.append("activation")

        async def stop():
            stops.append("gripper")

        async def end_recovery():
            await bench.devices.end_recovery()
            ended.append("recovery")

        monkeypatch.setattr(bench.gripper, "activate", travel)
        monkeypatch.setattr(bench.gripper, "stop", stop, raising=False)
        monkeypatch.setattr(bench.arm, "stop", stop, raising=False)
        await end_recovery()
        assert (stops, ended) == ([], ["recovery"]), "nothing is stopped where nothing is restored"
        bench.gripper.active, bench.arm.at = False, "home"
        activating = asyncio.create_task(bench.activate())
        await travelling.wait()
        ending = asyncio.create_task(end_recovery())
        while len(stops) < 2:
            await asyncio.sleep(0)
        arrived.set()
        await asyncio.gather(activating, ending)
        assert ended == ["recovery", "activation", "recovery"]

    asyncio.run(scenario())


def test_a_bug_in_one_device_keeps_neither_the_other_moving_nor_the_halt_from_its_end(bench, monkeypatch):
    stopped = []

    async def fails():
        raise RuntimeError("a bug")

    async def stop():
        stopped.append("arm")

    monkeypatch.setattr(bench.gripper, "stop", fails, raising=False)
    monkeypatch.setattr(bench.arm, "stop", stop, raising=False)
    asyncio.run(bench.devices.halt())
    assert stopped == ["arm"]
