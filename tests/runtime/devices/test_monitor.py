"""Device monitor: reports each change that means something else to the cycle, once."""

import asyncio
from types import SimpleNamespace

import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperNotActiveError
from station.messages import device as messages
from station.messages.message import verbatim
from station.messages.operation import INTERNAL_FAULT
from station.runtime.devices import manager
from station.runtime.devices import monitor as monitor_module
from station.runtime.devices.manager import DeviceManager
from station.runtime.devices.monitor import MEETING_S, DeviceMonitor
from station.runtime.devices.rig import FRAME_DEADLINE_S
from station.settings.camera import CameraSettings
from station.settings.configuration import Configuration


async def healthy() -> None:
    """A device with nothing wrong."""


def test_another_cause_is_reported_and_another_wording_of_the_same_is_not():
    reported = []
    monitor = DeviceMonitor("arm", messages.ARM(), healthy, 1.0, reported.append, lambda: None)
    stale, older, stopped = (
        ArmFault(cause, verbatim(detail))
        for cause, detail in ((ArmCause.STALE, "1 s"), (ArmCause.STALE, "2 s"), (ArmCause.PROTECTIVE_STOP, "stop"))
    )
    inactive = GripperNotActiveError(verbatim("not active"), verbatim("wait"))
    for fault in (stale, older, stopped, stopped, inactive, stale):
        monitor.report_fault(fault)
    assert reported == [stale, stopped, inactive, stale]


@pytest.mark.parametrize("deadline_s", [0.2, CameraSettings().open_deadline_s, 60.0])
def test_a_check_of_a_camera_that_does_not_open_ends_before_the_station_counts_as_stuck(
    tmp_path, monkeypatch, deadline_s
):
    used, camera_from = [], manager.camera_from
    monkeypatch.setattr(manager, "camera_from", lambda settings: (used.append(settings), camera_from(settings))[1])
    configuration = Configuration(home=tmp_path, camera=CameraSettings(open_deadline_s=deadline_s))
    DeviceManager(configuration, lambda *_: None, lambda _: None)
    [settings] = used
    assert settings.open_deadline_s + FRAME_DEADLINE_S < configuration.service.progress_s
    assert settings.open_deadline_s <= deadline_s


@pytest.mark.parametrize("answers", [True, False])
def test_what_an_operator_sees_of_a_device_is_decided_once_it_was_healthy_or_had_its_time_to_answer(
    monkeypatch, answers
):
    now_s = 100.0
    monkeypatch.setattr(monitor_module, "time", SimpleNamespace(monotonic=lambda: now_s))
    monitor = DeviceMonitor("arm", messages.ARM(), healthy, 1.0, lambda _: None, lambda: None)
    monitor.report_fault(ArmFault(ArmCause.STALE, verbatim("1 s")))
    assert not monitor.is_decided
    if answers:
        monitor.report_success()
    else:
        now_s += MEETING_S
    assert monitor.is_decided


def test_an_error_that_no_driver_should_raise_is_a_fault_until_the_next_check_finds_none(monkeypatch):
    monkeypatch.setattr(monitor_module, "PERIOD_S", 0.01)
    errors, reported = [RuntimeError("a bug")], []

    async def check():
        if errors:
            raise errors.pop()

    async def scenario():
        well = asyncio.Event()

        def changed(fault):
            reported.append(fault and fault.message)
            if fault is None:
                well.set()

        monitor = DeviceMonitor("gripper", messages.GRIPPER(), check, 1.0, changed, lambda: None)
        checking = asyncio.create_task(monitor.run())
        async with asyncio.timeout(10):
            await well.wait()
        checking.cancel()
        await asyncio.gather(checking, return_exceptions=True)

    asyncio.run(scenario())
    assert reported == [INTERNAL_FAULT(words="RuntimeError: a bug"), None]
