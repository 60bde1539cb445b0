"""Alarms that a fault raises while nothing is inspected, or by a reference that cannot serve; cleared after it."""

import asyncio
import shutil
import time

import pytest

from station.channel.line import CommandName
from station.devices.gripper.errors import GripperFaultError, GripperNotActiveError
from station.inspection.alarm_table import AlarmId
from station.inspection.alarms import CAUSED, AlarmState
from station.inspection.states import State
from station.messages import commands
from station.records.model import StoredAlarm
from station.records.records import Records
from station.runtime.devices.manager import ARM, GRIPPER
from station.runtime.production import plc_commands
from station.runtime.production.housekeeping import Housekeeping
from station.runtime.station import Station
from station.supervision.restarts import RESTARTS_VARIABLE, Restarts, publish
from tests.eventually import PATIENCE_S, until

# No alarm more than twice: one that comes a third time within a minute chatters, and stays.
WATCHED = {
    "camera": [
        ("off", 1.0, AlarmId.CAMERA_LOST),
        ("garbage", 1.0, AlarmId.CAMERA_LOST),
        ("stuck", 1.0, AlarmId.CAMERA_STALE),
        ("frame_black", 1.0, AlarmId.CAMERA_SATURATED),
        ("frame_torn", 1.0, AlarmId.CAMERA_SATURATED),
    ],
    "gripper": [
        ("off", 1.0, AlarmId.GRIPPER_LINK_LOST),
        ("garbage", 1.0, AlarmId.GRIPPER_LINK_LOST),
        ("over_temperature", 1.0, AlarmId.GRIPPER_FAULT),
    ],
}
REFERENCE_FAULTS = [
    ("led_dead", 1.0, AlarmId.CAMERA_LED_DEAD, True),
    ("lens_fogged", 1.0, AlarmId.CAMERA_DIRTY, True),
    ("dirt", 5.0, AlarmId.REFERENCE_BAD, True),
    ("gel_torn", 1.0, AlarmId.REFERENCE_BAD, True),
    ("lens_fogged", 0.53, AlarmId.REFERENCE_DRIFTING, False),
]


def caused(cell, alarm):
    return cell.station.service.alarms.alarms.get(alarm).state in CAUSED


FRAMES_UNDER_WAY = 6


def active(cell):
    return {alarm.id for alarm in cell.station.service.alarms.alarms.active}


@pytest.mark.parametrize("device", list(WATCHED))
def test_a_device_is_watched_while_nothing_is_inspected(bench, device):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            for fault, amount, alarm in WATCHED[device]:
                await cell.line.ready()
                others = {other for _, _, other in WATCHED[device]} - {alarm}
                cell.twin.boards[device].set(fault, amount)
                await until(lambda alarm=alarm: alarm in active(cell))
                assert not others & active(cell), fault
                cell.twin.boards[device].clear()
                await until(lambda alarm=alarm: not caused(cell, alarm))

    asyncio.run(scenario())


def test_a_reference_that_cannot_serve_says_what_is_wrong_with_the_gel(bench):
    async def scenario():
        # The last fog changes the light by 10 to 14 levels, as the twin's light drifts: over half of this limit.
        async with bench(reference={"most_drift_levels": 18.0}) as cell:
            await cell.choose("blueberry")
            await cell.line.inspect()  # its reference is the golden one
            for fault, amount, alarm, refused in REFERENCE_FAULTS:
                await cell.line.ready()
                cell.twin.boards["camera"].set(fault, amount)
                drawn = cell.twin.camera.drawn
                await until(lambda drawn=drawn: cell.twin.camera.drawn > drawn + FRAMES_UNDER_WAY)
                outcome = await cell.line.inspect()
                assert ("reference_bad" in outcome.reasons) == refused, (fault, outcome.reasons)
                assert alarm in active(cell), fault
                cell.twin.boards["camera"].clear()
            await cell.line.inspect()
            assert not any(caused(cell, alarm) for _, _, alarm, _ in REFERENCE_FAULTS)
            text = cell.station.service._metrics.exposition()[0].decode()
            assert 'station_references_refused_total{id="camera_led_dead"} 1.0' in text
            assert 'station_references_refused_total{id="reference_bad"} 2.0' in text
            assert 'station_inspection_deadline_seconds{fruit="blueberry"}' in text

    asyncio.run(scenario())


def test_what_the_supervisor_tells_of_restarts_is_counted_and_many_are_an_alarm(bench, tmp_path, monkeypatch):
    file = tmp_path / "restarts.json"
    monkeypatch.setenv(RESTARTS_VARIABLE, str(file))
    now_s = time.monotonic()

    async def scenario():
        async with bench() as cell:

            def counted():
                text = cell.station.service._metrics.exposition()[0].decode()
                return 'station_process_restarts_total{process="plc"} 3.0' in text

            publish(file, {"plc": Restarts(2, (now_s, now_s), given_up=False)})
            await asyncio.sleep(1.2)
            assert AlarmId.PROCESS_RESTARTS not in active(cell)
            publish(file, {"plc": Restarts(3, (now_s, now_s, now_s), given_up=False)})
            await until(lambda: AlarmId.PROCESS_RESTARTS in active(cell))
            assert counted()
            publish(file, {"plc": Restarts(3, (now_s - 100,) * 3, given_up=False)})
            await until(lambda: AlarmId.PROCESS_RESTARTS not in active(cell))
            file.write_text("rubbish")
            await asyncio.sleep(1.2)
            assert counted()
            publish(file, {"plc": Restarts(3, (), given_up=True)})
            await until(lambda: AlarmId.PROCESS_RESTARTS in active(cell))

    asyncio.run(scenario())


def test_an_under_voltage_of_the_gripper_stands_until_a_person_has_said_that_the_jaws_are_clear(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            cell.twin.boards["gripper"].set("under_voltage")
            await until(lambda: AlarmId.GRIPPER_FAULT in active(cell))
            assert (
                cell.station.service.alarms.alarms.get(AlarmId.GRIPPER_FAULT).detail == GripperFaultError(0xA).message
            )
            cell.twin.boards["gripper"].clear()
            cell.twin.world.remove()
            done = await cell.line.order(CommandName.RESET)
            assert done.done, done.why
            await cell.line.ready()
            await until(lambda: not caused(cell, AlarmId.GRIPPER_FAULT))

    asyncio.run(scenario())


def test_an_emergency_stop_that_the_gripper_tells_of_is_a_persons(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            cell.twin.boards["gripper"].set("emergency_stopped")
            await cell.reach(State.LATCHED)
            await until(lambda: AlarmId.EMERGENCY_STOP in active(cell))
            refused = await cell.line.order(CommandName.RESET)
            assert not refused.done
            assert refused.why.id == commands.CONFIRM_STOP.id
            cell.twin.boards["gripper"].clear()
            await until(lambda: not caused(cell, AlarmId.EMERGENCY_STOP))
            assert AlarmId.EMERGENCY_STOP in active(cell)  # latched
            assert cell.phase is State.LATCHED
            done = await cell.line.order(CommandName.RESET)
            assert done.done, done.why
            await cell.line.ready()
            assert AlarmId.EMERGENCY_STOP not in active(cell)

    asyncio.run(scenario())


async def latched_without_camera(cell, monkeypatch):
    """Bring the cell to a released emergency stop and a lost camera, by which a reset is too slow."""
    await cell.choose("blueberry")
    cell.twin.boards["gripper"].set("emergency_stopped")
    await cell.reach(State.LATCHED)
    cell.twin.boards["camera"].set("off")
    await until(lambda: "camera" in cell.station.service._devices.faults)
    cell.twin.boards["gripper"].clear()
    await until(lambda: not caused(cell, AlarmId.EMERGENCY_STOP))
    monkeypatch.setattr(plc_commands, "DEADLINE_S", 0.5)


def test_a_reset_that_a_lost_camera_delays_ends_the_stops_alarm_once_the_station_is_ready(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await latched_without_camera(cell, monkeypatch)
            late = await cell.line.order(CommandName.RESET)
            assert not late.done
            assert late.why.id == commands.TOO_SLOW.id
            assert AlarmId.EMERGENCY_STOP in active(cell)
            cell.twin.boards["camera"].clear()
            await cell.reach(State.IDLE)
            assert AlarmId.EMERGENCY_STOP not in active(cell)

    asyncio.run(scenario())


def test_a_restart_after_a_persons_reset_leaves_no_latched_alarm_behind(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await latched_without_camera(cell, monkeypatch)
            assert (await cell.line.order(CommandName.RESET)).why.id == commands.TOO_SLOW.id
            await cell.until(lambda: cell.phase is State.UNKNOWN)
            load_alarms = cell.station.service.registry.records.load_alarms
            stored = (AlarmId.EMERGENCY_STOP, AlarmState.LATCHED_UNACKNOWLEDGED)
            async with asyncio.timeout(PATIENCE_S):
                while stored not in [(row.id, row.state) for row in await load_alarms()]:
                    await asyncio.sleep(0.05)
            cell.station.stop()
            await cell.running
            cell.twin.boards["camera"].clear()
            cell.station = Station(cell.configuration, "")
            cell.running = asyncio.create_task(cell.station.run(lambda _port: None))
            try:
                await until(lambda: cell.station.service is not None and AlarmId.EMERGENCY_STOP in active(cell))
                await cell.until(lambda: cell.phase is State.IDLE)
                assert AlarmId.EMERGENCY_STOP not in active(cell)
            finally:
                cell.station.stop()
                await cell.running

    asyncio.run(scenario())


def test_the_alarm_of_a_stop_on_the_pendant_stays_until_a_person_has_confirmed(bench):
    async def scenario():
        async with bench(bench=False) as cell:
            await cell.choose("blueberry")
            devices = cell.station.service._devices
            cell.twin.boards["arm"].set("pendant_stop")
            await cell.until(lambda: cell.phase is State.LATCHED and ARM in devices.faults)
            cell.twin.boards["arm"].clear()
            await devices.recover("program")
            await cell.until(lambda: ARM not in devices.faults)
            cell.station.service.alarms.update_device(devices.monitors[ARM])
            assert cell.phase is State.LATCHED
            assert AlarmId.ARM_NOT_REMOTE in active(cell)
            assert (await cell.line.order(CommandName.RESET)).done
            await cell.until(lambda: AlarmId.ARM_NOT_REMOTE not in active(cell))

    asyncio.run(scenario())


def test_a_reset_of_a_ready_station_ends_what_is_latched(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            alarms = cell.station.service.alarms
            # As after a stop that came so often that its alarm outlasted the reset: it chattered.
            alarms.raise_(AlarmId.PROTECTIVE_STOP, None)
            alarms.clear(AlarmId.PROTECTIVE_STOP)
            assert AlarmId.PROTECTIVE_STOP in active(cell)
            assert (await cell.line.order(CommandName.RESET)).done
            assert AlarmId.PROTECTIVE_STOP not in active(cell)

    asyncio.run(scenario())


def test_little_space_on_the_disk_is_told_before_it_is_too_little(bench, monkeypatch):
    free_mb = 3.0

    def disk_usage(_path):
        return shutil._ntuple_diskusage(10**9, 0, int(free_mb * 1e6))

    monkeypatch.setattr(shutil, "disk_usage", disk_usage)

    async def scenario():
        nonlocal free_mb
        async with bench() as cell:  # which keeps 1 MB in reserve
            await cell.choose("blueberry")
            await cell.line.ready()
            assert AlarmId.DISK_LOW not in active(cell)
            free_mb = 1.5
            await until(lambda: AlarmId.DISK_LOW in active(cell))
            assert (await cell.line.inspect()).area_mm2 is not None
            free_mb = 3.0
            await until(lambda: AlarmId.DISK_LOW not in active(cell))

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_many_fruit_that_cannot_be_judged_are_an_alarm_until_one_can(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("raspberry")
            cell.twin.world.remove()
            for _ in range(5):
                assert AlarmId.MANY_NO_RESULT not in active(cell)
                assert (await cell.line.inspect()).outcome == "NO_RESULT"
            assert AlarmId.MANY_NO_RESULT in active(cell)
            cell.lay("raspberry", 1, bruised=True)
            assert (await cell.line.inspect()).outcome == "FAIL"
            assert not caused(cell, AlarmId.MANY_NO_RESULT)

    asyncio.run(scenario())


@pytest.fixture
def updates(monkeypatch):
    """Return a note of each update of the alarms by housekeeping."""
    made, update = [], Housekeeping._update_alarms

    def noted(self):
        update(self)
        made.append(self)

    monkeypatch.setattr(Housekeeping, "_update_alarms", noted)
    return made


def stored(monkeypatch, alarm):
    """Have the records give an acknowledged alarm to the next start."""
    raised_ms = round(1000 * (time.time() - 60.0))

    async def load_alarms(_):
        return (StoredAlarm(alarm, AlarmState.ACKNOWLEDGED, raised_ms, raised_ms),)

    monkeypatch.setattr(Records, "load_alarms", load_alarms)


@pytest.mark.timeout(240)
def test_an_alarm_of_a_device_that_is_still_faulty_outlives_a_restart_as_it_was(bench, updates, monkeypatch):
    """On a bench the gripper waits for a person's reset, which activates it."""
    stored(monkeypatch, AlarmId.GRIPPER_FAULT)

    async def scenario():
        async with bench() as cell:
            service = cell.station.service
            monitor = service._devices.monitors[GRIPPER]
            await until(lambda: isinstance(monitor.fault, GripperNotActiveError) and len(updates) > 2)
            alarm = service.alarms.alarms.get(AlarmId.GRIPPER_FAULT)
            assert (alarm.state, alarm.raised) == (AlarmState.ACKNOWLEDGED, 1)
            await cell.choose("blueberry")
            await cell.line.ready()
            await until(lambda: AlarmId.GRIPPER_FAULT not in active(cell))

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_an_alarm_of_an_arm_that_was_configured_away_is_over_after_the_start(bench, monkeypatch):
    stored(monkeypatch, AlarmId.ARM_LINK_LOST)

    async def scenario():
        async with bench() as cell:
            await until(lambda: AlarmId.ARM_LINK_LOST not in active(cell))

    asyncio.run(scenario())
