"""The alarm manager: a cause that stays, what is found about it, and the alarm of each fault of the arm."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperNotActiveError
from station.inspection.alarm_table import AlarmId
from station.messages import gripper as gripper_messages
from station.messages.message import message_of, verbatim
from station.messages.operation import INTERFACE_SILENT
from station.records.model import StoredAlarm
from station.runtime.alarms.manager import OF_DEVICE, AlarmManager
from station.runtime.devices.manager import ARM, CAMERA, GRIPPER
from station.runtime.observability.metrics import Metrics


def test_a_later_finding_is_the_alarms_detail_and_no_second_alarm():
    manager = AlarmManager(Metrics("0", 1.0))
    for age_s in (2.0, 3.0):
        manager.update(AlarmId.PLC_INTERFACE_LOST, INTERFACE_SILENT(age_s=age_s))
    alarm = manager.alarms.get(AlarmId.PLC_INTERFACE_LOST)
    assert alarm.detail == INTERFACE_SILENT(age_s=3.0)
    assert alarm.raised == 1
    manager.update(AlarmId.PLC_INTERFACE_LOST, None)
    assert alarm.id not in [each.id for each in manager.alarms.active]


def test_the_detail_of_a_devices_alarm_is_what_a_person_has_to_do_now():
    manager = AlarmManager(Metrics("0", 1.0))
    wait = GripperNotActiveError(gripper_messages.NOT_ACTIVE(), gripper_messages.REMEDY_WAIT())
    empty = GripperNotActiveError(gripper_messages.JAWS_UNKNOWN(), gripper_messages.REMEDY_EMPTY_JAWS())
    for fault in (wait, empty):
        manager.set_device_fault(GRIPPER, fault)
    alarm = manager.alarms.get(AlarmId.GRIPPER_FAULT)
    assert alarm.detail == message_of(empty)
    assert alarm.raised == 1
    manager.set_device_fault(GRIPPER, None)
    assert not manager.alarms.active


def test_a_restart_restores_detail_and_shelf_of_an_alarm():
    until_ms = round(1000 * time.time()) + 600_000

    async def load_alarms():
        return (StoredAlarm(AlarmId.DISK_LOW, "shelved", 2_000, 3_000, "2 GB left", until_ms, "Ida"),)

    records: Any = SimpleNamespace(load_alarms=load_alarms, notices=())
    manager = AlarmManager(Metrics("0", 1.0), to_restore=True)
    asyncio.run(manager.restore(records))
    alarm = manager.alarms.get(AlarmId.DISK_LOW)
    assert (alarm.state, alarm.detail, alarm.since_s) == ("shelved", verbatim("2 GB left"), 2.0)
    assert (alarm.shelved_until_s, alarm.shelved_by) == (until_ms / 1000, "Ida")


OWN_ALARM = {
    ArmCause.EMERGENCY_STOP: AlarmId.EMERGENCY_STOP,
    ArmCause.PROTECTIVE_STOP: AlarmId.PROTECTIVE_STOP,
    ArmCause.SAFETY_FAULT: AlarmId.SAFETY_FAULT,
    **dict.fromkeys(
        (ArmCause.LOCAL_CONTROL, ArmCause.PROGRAM_STOPPED, ArmCause.REGISTERS_IN_USE), AlarmId.ARM_NOT_REMOTE
    ),
    **dict.fromkeys((ArmCause.LINK_LOST, ArmCause.STALE, ArmCause.DEADLINE, ArmCause.CLOSED), AlarmId.ARM_LINK_LOST),
}


@pytest.mark.parametrize("cause", ArmCause)
def test_only_an_arm_that_does_not_answer_has_the_alarm_of_its_network_cable(cause):
    manager = AlarmManager(Metrics("0", 1.0))
    manager.set_device_fault(ARM, ArmFault(cause, verbatim("the arm's own")))
    [alarm] = manager.alarms.active
    assert alarm.id is OWN_ALARM.get(cause, AlarmId.ARM_NOT_READY)
    assert alarm.id in OF_DEVICE[ARM]
    manager.set_device_fault(ARM, None)
    manager.reset()
    assert not manager.alarms.active


def test_the_alarms_of_an_arm_that_was_configured_away_end_and_those_that_a_gripper_shares_do_not():
    async def load_alarms():
        shared = (AlarmId.ARM_LINK_LOST, AlarmId.EMERGENCY_STOP, AlarmId.GRIPPER_FAULT)
        return tuple(StoredAlarm(alarm, "acknowledged", 1, 1) for alarm in shared)

    records: Any = SimpleNamespace(load_alarms=load_alarms, notices=())
    manager = AlarmManager(Metrics("0", 1.0), to_restore=True)
    asyncio.run(manager.restore(records))
    manager.clear_absent({ARM, CAMERA, GRIPPER})
    assert {alarm.id for alarm in manager.alarms.active} == {
        AlarmId.ARM_LINK_LOST,
        AlarmId.EMERGENCY_STOP,
        AlarmId.GRIPPER_FAULT,
    }
    manager.clear_absent({CAMERA, GRIPPER})
    assert {alarm.id for alarm in manager.alarms.active} == {AlarmId.EMERGENCY_STOP, AlarmId.GRIPPER_FAULT}


def test_an_alarm_that_two_devices_raise_stays_as_it_was_until_both_were_heard():
    async def load_alarms():
        return (StoredAlarm(AlarmId.EMERGENCY_STOP, "acknowledged", 1, 1),)

    records: Any = SimpleNamespace(load_alarms=load_alarms, notices=())
    manager = AlarmManager(Metrics("0", 1.0), to_restore=True)
    manager.clear_absent((ARM, CAMERA, GRIPPER))
    asyncio.run(manager.restore(records))
    manager.set_device_fault(GRIPPER, None)
    assert manager.alarms.get(AlarmId.EMERGENCY_STOP).state == "acknowledged"
    manager.set_device_fault(ARM, None)
    assert manager.alarms.get(AlarmId.EMERGENCY_STOP).state != "acknowledged"
