"""Gripper without values behind its URCap: an emergency stop only if its arm reports one or there is no arm."""

import asyncio
from dataclasses import dataclass
from typing import Any

import pytest

from station.devices.arm.arm import ArmState
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperEmergencyStopError, GripperError, GripperNoValuesError
from station.inspection.alarm_table import AlarmId
from station.messages.message import verbatim
from station.runtime.alarms.manager import alarm_of
from station.runtime.devices import manager
from station.runtime.devices.manager import GRIPPER, DeviceManager
from station.settings.configuration import Configuration
from station.settings.gripper import GripperSettings, UrcapSettings
from station.twin.clock import SteadyClock
from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.urcap import UrcapServer


@dataclass
class Arm:
    """An arm whose state shows its fault from the second reading on."""

    cause: ArmCause | None
    readings: int = 0

    async def state(self):
        self.readings += 1
        cause = self.cause if self.readings > 1 else None
        fault = None if cause is None else ArmFault(cause, verbatim("the arm's own"))
        return ArmState(0.01, (0.0,) * 6, moving=False, at="home", fault=fault)


@pytest.mark.parametrize(
    ("arm", "error", "alarm"),
    [
        (Arm(None), GripperNoValuesError, AlarmId.GRIPPER_LINK_LOST),
        (Arm(ArmCause.NOT_POWERED), GripperNoValuesError, AlarmId.GRIPPER_LINK_LOST),
        (Arm(ArmCause.EMERGENCY_STOP), GripperEmergencyStopError, AlarmId.EMERGENCY_STOP),
        (None, GripperEmergencyStopError, AlarmId.EMERGENCY_STOP),
    ],
)
def test_a_gripper_without_values_is_emergency_stopped_only_if_its_arm_is(tmp_path, monkeypatch, arm, error, alarm):
    monkeypatch.setattr(manager, "_STOP_POLL_S", 0.0)
    monkeypatch.setattr(manager, "_STOP_SHOWN_S", 60.0 if error is GripperEmergencyStopError else 0.05)

    async def scenario():
        faults = gripper_faults()
        server = UrcapServer(RobotiqGripper(SteadyClock(), faults), port=0)
        await server.start()
        urcap = UrcapSettings(host=server.host, port=server.port)
        devices = DeviceManager(
            Configuration(home=tmp_path, gripper=GripperSettings(urcap=urcap)), lambda *_: None, lambda _: None
        )
        stood_in: Any = arm
        devices._arm = stood_in
        try:
            faults.set("emergency_stopped")
            with pytest.raises(GripperError) as caught:
                await devices.cell.gripper.read()
            assert type(caught.value) is error
            assert alarm_of(GRIPPER, caught.value) is alarm
            devices.report_fault(caught.value)
            assert (devices.active_stop is not None) == (error is GripperEmergencyStopError)
            faults.clear()
            assert not (await devices.cell.gripper.read()).active, "the link goes on by itself"
        finally:
            await devices.cell.gripper.close()
            await server.stop()

    asyncio.run(scenario())
