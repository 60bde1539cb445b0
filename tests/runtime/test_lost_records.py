"""Records that were lost: an alarm from the start, or from the recovery, until a person has acknowledged it."""

import asyncio
import contextlib
import errno
import json
import os

import pytest

from station.inspection.alarm_table import AlarmId
from station.messages import records as messages
from station.records import open as opening
from station.records.database import FILE_NAME
from station.records.errors import RecordsDeadlineError
from station.records.model import Trigger
from station.records.records import Records
from station.runtime.station import Station
from station.settings.configuration import load_configuration
from station.settings.records import RecordsSettings
from tests.command_line import call
from tests.ports import free_port

LIMIT_S = 90.0
TRIGGER = Trigger(trigger_id=7, encoder=1, lot="A-17", began_utc_ms=1_700_000_000_000, recipe=None, simulated=True)


def damage(file):
    file.write_bytes(b"rubbish" * 1000)


def remove(file):
    for path in file.parent.glob(f"{FILE_NAME}*"):
        path.unlink()


@pytest.fixture
def site(tmp_path):
    """The configuration of a station; no device is at its devices' addresses."""
    values = {
        "home": str(tmp_path / "home"),
        "gripper": {"urcap": {"host": "127.0.0.1", "port": 1}},
        "camera": {"twin": {"port": 1}},
        "metrics": {"port": free_port()},
        "records": {"free_reserve_mb": 1, "deadline_s": 30},
        "service": {"bench": True},
    }
    file = tmp_path / "station.yaml"
    file.write_text(json.dumps(values))
    return load_configuration(file, {})


@pytest.fixture
def database(site):
    """The database of a station that has inspected a fruit."""

    async def begin():
        records = await Records.open(site.home / "records", RecordsSettings(free_reserve_mb=1), "an earlier start")
        await records.begin(TRIGGER)
        await records.close()

    asyncio.run(begin())
    return site.home / "records" / FILE_NAME


@contextlib.asynccontextmanager
async def started(configuration):
    station, ready = Station(configuration), asyncio.Event()
    running = asyncio.create_task(station.run(lambda _port: ready.set()))
    await asyncio.wait({running, asyncio.create_task(ready.wait())}, return_when=asyncio.FIRST_COMPLETED)
    assert station.service is not None
    try:
        yield station.service
    finally:
        station.stop()
        await running


def alarm_of(service):
    return service.alarms.alarms.get(AlarmId.RECORDS_LOST)


def is_raised_for(service, database):
    """The alarm names the folder of what was lost."""
    (aside,) = (database.parent / "aside").iterdir()
    alarm = alarm_of(service)
    return alarm.state == "unacknowledged" and str(aside) in str(alarm.detail)


async def until_stored(service, state):
    """Wait until the records have the alarm in this state."""
    load_alarms = service.registry.records.load_alarms
    async with asyncio.timeout(LIMIT_S):
        while (AlarmId.RECORDS_LOST, state) not in [(row.id, row.state) for row in await load_alarms()]:
            await asyncio.sleep(0.02)


@pytest.mark.parametrize("lose", [damage, remove])
def test_records_lost_while_no_station_ran_are_an_alarm_until_it_is_acknowledged(site, database, lose):
    lose(database)

    async def scenario():
        async with started(site) as service:
            assert is_raised_for(service, database)
            await until_stored(service, "unacknowledged")
            assert service.alarms.acknowledge(AlarmId.RECORDS_LOST)
            assert alarm_of(service).state == "normal"
            await until_stored(service, "normal")
        async with started(site) as service:
            assert alarm_of(service).state == "normal"

    asyncio.run(scenario())


def test_records_lost_while_the_station_runs_are_an_alarm_also_after_the_next_start(site, database):
    async def scenario():
        async with started(site) as service:
            assert alarm_of(service).state == "normal"
            remove(database)
            service.device_changed(await service.registry.find_damage())
            async with asyncio.timeout(LIMIT_S):
                while service.registry.fault is not None:
                    await asyncio.sleep(0.02)
            assert is_raised_for(service, database)
            await until_stored(service, "unacknowledged")
        async with started(site) as service:
            assert is_raised_for(service, database)

    asyncio.run(scenario())


@pytest.mark.parametrize("lose", [damage, remove])
def test_records_lost_in_a_start_that_ended_before_the_alarm_was_stored_are_an_alarm_of_the_next(site, database, lose):
    lose(database)

    async def scenario():
        records = await Records.open(site.home / "records", RecordsSettings(free_reserve_mb=1), "ends at once")
        await records.close()
        async with started(site) as service:
            assert is_raised_for(service, database)

    asyncio.run(scenario())


def test_records_lost_in_an_opening_that_failed_are_an_alarm_once_they_are_open(site, database, monkeypatch):
    damage(database)
    migrate, attempts = opening.migrate, []

    def full_at_first(*of):
        attempts.append(of)
        if len(attempts) == 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        migrate(*of)

    monkeypatch.setattr(opening, "migrate", full_at_first)

    async def scenario():
        async with started(site) as service:
            assert service.registry.fault is not None
            async with asyncio.timeout(LIMIT_S):
                while alarm_of(service).state == "normal":
                    await asyncio.sleep(0.02)
            assert is_raised_for(service, database)
            await until_stored(service, "unacknowledged")

    asyncio.run(scenario())


def test_records_lost_are_an_alarm_where_the_stored_alarms_cannot_be_read_at_first(site, database, monkeypatch):
    damage(database)
    load_alarms, attempts = Records.load_alarms, []

    async def slow_at_first(self):
        attempts.append(self)
        if len(attempts) == 1:
            raise RecordsDeadlineError(messages.TOO_SLOW(limit_s=2.0), messages.CHECK_DISK())
        return await load_alarms(self)

    monkeypatch.setattr(Records, "load_alarms", slow_at_first)

    async def scenario():
        async with started(site) as service:
            async with asyncio.timeout(LIMIT_S):
                while alarm_of(service).state == "normal":
                    await asyncio.sleep(0.02)
            assert is_raised_for(service, database)

    asyncio.run(scenario())


def test_a_station_whose_records_cannot_be_opened_recovers_the_arm_for_the_command_line(site, tmp_path, monkeypatch):
    async def broken(_self):
        raise RecordsDeadlineError(messages.TOO_SLOW(limit_s=2.0), messages.CHECK_DISK())

    monkeypatch.setattr(Records, "reopen", broken)

    async def scenario():
        async with started(site) as service:
            assert service.registry.fault is not None
            recover = ("devices", "recover", "program", "--yes", "--config", tmp_path / "station.yaml")
            return await asyncio.to_thread(call, *recover)

    assert asyncio.run(scenario()) == (0, "the arm is ready\n")


@pytest.mark.parametrize("failing", ["reopen", "load_alarms"])
def test_alarms_of_the_previous_start_outlive_an_opening_that_fails_at_first(site, database, monkeypatch, failing):
    damage(database)

    async def scenario():
        async with started(site) as service:
            await until_stored(service, "unacknowledged")
        sound, attempts = getattr(Records, failing), []

        async def slow_at_first(self):
            attempts.append(self)
            if len(attempts) == 1:
                raise RecordsDeadlineError(messages.TOO_SLOW(limit_s=2.0), messages.CHECK_DISK())
            return await sound(self)

        monkeypatch.setattr(Records, failing, slow_at_first)
        async with started(site) as service:
            assert alarm_of(service).state == "normal"
            async with asyncio.timeout(LIMIT_S):
                while service.registry.fault is not None:
                    await asyncio.sleep(0.02)
            assert is_raised_for(service, database)
        async with started(site) as service:
            assert is_raised_for(service, database)

    asyncio.run(scenario())
