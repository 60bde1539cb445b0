"""A disk that is slower than the deadline: each entry of the audit trail and of the alarms' log is written once."""

import asyncio
import sqlite3
import threading

import pytest

from station.inspection.alarm_table import AlarmId
from station.messages.message import verbatim
from station.records import records as module
from station.records.audit import AuditEntry
from station.runtime.alarms import manager
from station.runtime.alarms.manager import AlarmManager
from station.runtime.observability import audit_logger
from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.observability.metrics import Metrics

DEADLINE_S = 0.2


@pytest.fixture
def slow(monkeypatch):
    """Make a request of the records wait in the writer's thread; return the events "started" and "may end"."""

    def make(request):
        started, gate = threading.Event(), threading.Event()
        carry_out = getattr(module, request)

        def slowly(*arguments):
            started.set()
            gate.wait(30)
            return carry_out(*arguments)

        monkeypatch.setattr(module, request, slowly)
        return started, gate

    return make


async def pass_deadline(started):
    """Wait until the request is under way and the records' deadline has passed."""
    while not started.is_set():
        await asyncio.sleep(0.005)
    await asyncio.sleep(2 * DEADLINE_S)


async def end(task):
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def written(folder, statement):
    connection = sqlite3.connect(folder / "records.sqlite3")
    try:
        return [row[0] for row in connection.execute(statement)]
    finally:
        connection.close()


def subjects(folder):
    return written(folder, "SELECT subject FROM audit WHERE action = 'test.done' ORDER BY seq")


def entry(subject):
    return AuditEntry("Ida", "quality", "test.done", subject)


@pytest.mark.parametrize("cancelled", [False, True], ids=["it goes on", "the station ends meanwhile"])
def test_an_entry_that_outlasts_the_deadline_is_one_row(opened, scenario, folder, slow, *, cancelled):
    async def steps():
        async with opened(deadline_s=DEADLINE_S) as records:
            started, gate = slow("append_audit")
            logger = AuditLogger(records)
            running = asyncio.create_task(logger.run())
            logger.log(entry("a"))
            await pass_deadline(started)
            if cancelled:
                await end(running)
            gate.set()
            await logger.flush()
            await end(running)

    scenario(steps)
    assert subjects(folder) == ["a"]


def test_the_oldest_entry_that_is_lost_is_not_the_one_being_written(opened, scenario, folder, slow, monkeypatch):
    monkeypatch.setattr(audit_logger, "MOST_WAITING", 3)

    async def steps():
        async with opened() as records:
            started, gate = slow("append_audit")
            logger = AuditLogger(records)
            running = asyncio.create_task(logger.run())
            logger.log(entry("a"))
            await pass_deadline(started)
            logger.log(entry("b"), entry("c"))
            logger.log(entry("d"), entry("e"), entry("f"))
            gate.set()
            await logger.flush()
            await end(running)

    scenario(steps)
    assert subjects(folder) == ["a", "d", "e", "f"]


def test_an_alarm_that_outlasts_the_deadline_is_one_row_of_the_log(opened, scenario, folder, slow):
    def logged():
        return written(folder, "SELECT id FROM alarms_log ORDER BY row")

    async def steps():
        async with opened(deadline_s=DEADLINE_S) as records:
            started, gate = slow("replace_alarms")
            alarms = AlarmManager(Metrics("0", 15.0))
            storing = asyncio.create_task(alarms.store_changes(records))
            alarms.raise_(AlarmId.DISK_LOW, verbatim("2 GB left"))
            await pass_deadline(started)
            gate.set()
            alarms.raise_(AlarmId.HMI_LOST, verbatim("silent"))
            while AlarmId.HMI_LOST not in logged():
                await asyncio.sleep(0.005)
            await end(storing)

    scenario(steps)
    assert logged() == [AlarmId.DISK_LOW, AlarmId.HMI_LOST]


def test_alarm_changes_beyond_the_most_that_wait_drop_the_oldest_alone(opened, scenario, folder, slow, monkeypatch):
    monkeypatch.setattr(manager, "_MOST_UNSAVED", 2)

    def logged():
        return written(folder, "SELECT id FROM alarms_log ORDER BY row")

    async def steps():
        async with opened() as records:
            started, gate = slow("replace_alarms")
            alarms = AlarmManager(Metrics("0", 15.0))
            storing = asyncio.create_task(alarms.store_changes(records))
            alarms.raise_(AlarmId.DISK_LOW, verbatim("2 GB left"))
            await pass_deadline(started)
            for alarm in (AlarmId.HMI_LOST, AlarmId.OUTBOX_BEHIND, AlarmId.CAMERA_LOST):
                alarms.raise_(alarm, verbatim("now"))
            gate.set()
            while AlarmId.CAMERA_LOST not in logged():
                await asyncio.sleep(0.005)
            await end(storing)

    scenario(steps)
    assert logged() == [AlarmId.DISK_LOW, AlarmId.OUTBOX_BEHIND, AlarmId.CAMERA_LOST]


def test_entries_that_a_slow_disk_has_not_taken_by_the_end_are_logged(opened, scenario, slow, monkeypatch, caplog):
    monkeypatch.setattr(audit_logger, "FLUSH_S", DEADLINE_S)

    async def steps():
        async with opened() as records:
            started, gate = slow("append_audit")
            logger = AuditLogger(records)
            running = asyncio.create_task(logger.run())
            logger.log(entry("under way"), entry("waiting"))
            await pass_deadline(started)
            await end(running)
            logger.log(entry("the end"))
            await logger.flush()
            gate.set()

    scenario(steps)
    (lost,) = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert lost.startswith("the audit trail could not take: ")
    places = [lost.index(repr(subject)) for subject in ("under way", "waiting", "the end")]
    assert places == sorted(places)
