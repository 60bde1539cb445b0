"""Alarms that a fault raises while nothing is inspected, or by a reference that cannot serve; cleared after it."""

import asyncio
import time

import pytest

from station.inspection.alarm_table import AlarmId
from station.inspection.alarms import CAUSED
from station.supervision.restarts import RESTARTS_VARIABLE, Restarts, tell

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
LOOKED_AT = [
    ("led_dead", 1.0, AlarmId.CAMERA_LED_DEAD, True),
    ("lens_fogged", 1.0, AlarmId.CAMERA_DIRTY, True),
    ("dirt", 5.0, AlarmId.REFERENCE_BAD, True),
    ("gel_torn", 1.0, AlarmId.REFERENCE_BAD, True),
    ("lens_fogged", 0.55, AlarmId.REFERENCE_DRIFTING, False),
]


@pytest.fixture
def until():
    """Poll with a deadline."""

    async def poll(holds):
        async with asyncio.timeout(60):
            while not holds():
                await asyncio.sleep(0.02)

    return poll


def caused(cell, alarm):
    return cell.station.service.alarms.alarms.get(alarm).state in CAUSED


def active(cell):
    return {alarm.id for alarm in cell.station.service.alarms.alarms.active}


@pytest.mark.parametrize("device", list(WATCHED))
def test_a_device_is_watched_while_nothing_is_inspected(bench, until, device):
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


def test_a_reference_that_cannot_serve_says_what_is_wrong_with_the_gel(bench, until):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.inspect()  # its reference is the golden one
            for fault, amount, alarm, refused in LOOKED_AT:
                await cell.line.ready()
                cell.twin.boards["camera"].set(fault, amount)
                await asyncio.sleep(0.2)  # frames that were drawn before are over
                outcome = await cell.line.inspect()
                assert ("reference_bad" in outcome.reasons) == refused, (fault, outcome.reasons)
                assert alarm in active(cell), fault
                cell.twin.boards["camera"].clear()
            await cell.line.inspect()
            assert not any(caused(cell, alarm) for _, _, alarm, _ in LOOKED_AT)

    asyncio.run(scenario())


def test_what_the_supervisor_tells_of_restarts_is_counted_and_many_are_an_alarm(bench, until, tmp_path, monkeypatch):
    file = tmp_path / "restarts.json"
    monkeypatch.setenv(RESTARTS_VARIABLE, str(file))
    now_s = time.monotonic()

    async def scenario():
        async with bench() as cell:

            def counted():
                text = cell.station.service._metrics.exposition()[0].decode()
                return 'station_process_restarts_total{process="plc"} 3.0' in text

            tell(file, {"plc": Restarts(2, (now_s, now_s), given_up=False)})
            await asyncio.sleep(1.2)
            assert AlarmId.PROCESS_RESTARTS not in active(cell)
            tell(file, {"plc": Restarts(3, (now_s, now_s, now_s), given_up=False)})
            await until(lambda: AlarmId.PROCESS_RESTARTS in active(cell))
            assert counted()
            tell(file, {"plc": Restarts(3, (now_s - 100,) * 3, given_up=False)})
            await until(lambda: AlarmId.PROCESS_RESTARTS not in active(cell))
            file.write_text("rubbish")
            await asyncio.sleep(1.2)
            assert counted()
            tell(file, {"plc": Restarts(3, (), given_up=True)})
            await until(lambda: AlarmId.PROCESS_RESTARTS in active(cell))

    asyncio.run(scenario())
