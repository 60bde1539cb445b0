"""The runner: events in their order, actions beside them, and what HALT forgets."""

import asyncio

import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import NoFrameError
from station.devices.gripper.errors import GripperFaultError
from station.errors import StationError
from station.inspection.cycle import Action, Event
from station.inspection.states import State
from station.messages.message import verbatim
from station.records.errors import DiskFullError
from station.runtime.cycle.runner import CycleRunner, event_of
from station.runtime.devices.rig import FramesError


@pytest.mark.parametrize(
    ("fault", "event"),
    [
        (ArmFault(ArmCause.PROTECTIVE_STOP, verbatim("x")), Event.PROTECTIVE_STOP),
        (ArmFault(ArmCause.EMERGENCY_STOP, verbatim("x")), Event.EMERGENCY_STOP),
        (ArmFault(ArmCause.SAFETY_FAULT, verbatim("x")), Event.SAFETY_FAULT),
        (ArmFault(ArmCause.LINK_LOST, verbatim("x")), Event.ARM_FAULT),
        (GripperFaultError(0xC), Event.GRIPPER_FAULT),
        (NoFrameError("x"), Event.CAMERA_FAULT),
        (FramesError(verbatim("x"), ()), Event.CAMERA_FAULT),
        (DiskFullError(verbatim("x"), verbatim("y")), Event.RECORDS_FAULT),
        (StationError("x"), Event.INTERNAL_FAULT),
        (ValueError("x"), Event.INTERNAL_FAULT),
    ],
)
def test_every_fault_is_an_event_of_the_cycle(fault, event):
    assert event_of(fault) is event


class Script:
    """A performer whose actions end as given, or never."""

    def __init__(self, ends):
        self.ends = ends
        self.started, self.alarms, self.unexpected, self.halts = [], [], [], 0

    def perform(self, action, because):
        self.started.append(action)
        if action not in self.ends:
            return None

        async def work():
            end = self.ends[action]
            if isinstance(end, Exception):
                raise end
            if end is None:
                await asyncio.Event().wait()
            return end

        return work

    def storing(self, event, state):
        return None

    async def halt(self):
        self.halts += 1

    def raise_alarm(self, alarm, why):
        self.alarms.append(alarm.alarm)

    def failed(self, fault): ...

    def entered(self, state, after, took_s): ...

    def refused(self, state, event):
        self.unexpected.append((state, event))

    def tick(self): ...


def conduct(script, scenario):
    async def run():
        runner = CycleRunner(script)
        running = asyncio.create_task(runner.run())
        try:
            async with asyncio.timeout(20):
                await scenario(runner)
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(run())


GETTING_READY = {
    Action.CLOSE_UNFINISHED: Event.UNFINISHED_CLOSED,
    Action.OPEN_JAWS: Event.JAWS_OPEN,
    Action.GO_HOME: Event.HOME,
    Action.CHECK_DEVICES: Event.READY,
}


def test_actions_lead_on_and_an_unlisted_event_is_counted(caplog):
    script = Script(GETTING_READY)

    async def scenario(runner):
        runner.post(Event.PLACED)
        runner.post(Event.READY)
        await runner.until(lambda state: state is State.STOPPED)
        runner.post(Event.RESET)
        await runner.until(lambda state: state is State.IDLE)

    conduct(script, scenario)
    assert script.unexpected == [(State.UNKNOWN, Event.PLACED)]
    assert script.started == [
        Action.READ_DEVICES,
        Action.CLOSE_UNFINISHED,
        Action.OPEN_JAWS,
        Action.GO_HOME,
        Action.CHECK_DEVICES,
    ]


def test_what_was_halted_ends_with_no_event_and_a_bug_is_a_fault(caplog):
    script = Script({**GETTING_READY, Action.GO_HOME: None})

    async def scenario(runner):
        runner.post(Event.READY)
        await runner.until(lambda state: state is State.STOPPED)
        runner.post(Event.RESET)
        await runner.until(lambda state: state is State.HOMING)
        runner.post(Event.GRIPPER_FAULT)
        await runner.until(lambda state: state is State.HELD)
        script.ends[Action.CLOSE_UNFINISHED] = ZeroDivisionError("a bug")
        runner.post(Event.READY)
        await runner.until(lambda state: state is State.HELD and script.halts == 2)

    conduct(script, scenario)
    assert script.unexpected == []
