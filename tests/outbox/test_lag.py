"""The alarm for other systems that lag behind: raised by a PostgreSQL that is away, gone when it is back."""

import asyncio
import json
import time
from types import SimpleNamespace
from typing import Any

import pytest

from station.clock import utc_ms
from station.inspection.alarm_table import AlarmId
from station.messages import outbox as messages
from station.outbox import lag
from station.outbox.lag import OutboxMonitor
from station.outbox.publisher import run_outbox
from station.outbox.status import DestinationStatus, outbox_folder, write_status
from station.records.audit import AuditEntry
from station.runtime.station import Station
from station.settings.configuration import load_configuration
from tests.command_line import call
from tests.eventually import until
from tests.ports import free_port

AWAY = messages.NOT_YET_CONNECTED()
LIMIT_S = 90.0


def ids(message):
    """The ids of a message and of what it encloses."""
    return set() if message is None else set(message.ids())


@pytest.fixture
def site(tmp_path):
    """The configuration of a station that publishes to a PostgreSQL; no device is at its devices' addresses."""

    def make(host="/nowhere", **outbox):
        postgresql = {"enabled": True, "host": str(host), "user": "fruit", "tls": "disable"}
        values = {
            "home": str(tmp_path / "home"),
            "gripper": {"urcap": {"host": "127.0.0.1", "port": 1}},
            "camera": {"twin": {"port": 1}},
            "metrics": {"port": free_port()},
            "records": {"free_reserve_mb": 1, "deadline_s": 30},
            "service": {"bench": True},
            "outbox": {"station": "lag", "longest_pause_s": 0.3, **outbox, "postgresql": postgresql},
        }
        file = tmp_path / "station.yaml"
        file.write_text(json.dumps(values))
        return load_configuration(file, {})

    return make


def test_a_postgresql_that_is_away_is_an_alarm_until_it_was_told_all(server, site):
    configuration = site(server.folder, alarm_after_rows=30)
    station = Station(configuration)

    def alarm():
        assert station.service is not None
        return station.service.alarms.alarms.get(AlarmId.OUTBOX_BEHIND)

    async def scenario():
        started = asyncio.Event()
        running = asyncio.create_task(station.run(lambda _port: started.set()))
        await asyncio.wait({running, asyncio.create_task(started.wait())}, return_when=asyncio.FIRST_COMPLETED)
        publishing = asyncio.create_task(run_outbox(configuration.outbox, configuration.home))
        try:
            status = outbox_folder(configuration.home) / "status.json"
            await until(lambda: status.exists() and '"connected":true' in status.read_text(), LIMIT_S)
            assert alarm().state == "normal"
            await asyncio.to_thread(server.stop, "fast")
            entries = [AuditEntry("ada", "quality", "tried", f"thing {number}") for number in range(40)]
            assert station.service is not None
            await station.service.registry.records.audit(*entries)
            await until(lambda: alarm().state == "unacknowledged", LIMIT_S)
            assert "postgresql: 4" in str(alarm().detail)
            assert "entries wait, for " in str(alarm().detail)
            await asyncio.to_thread(server.start)
            await until(lambda: alarm().state == "returned", LIMIT_S)
        finally:
            if not (server.folder / "data" / "postmaster.pid").exists():  # other tests use it too
                await asyncio.to_thread(server.start)
            publishing.cancel()
            station.stop()
            await asyncio.gather(publishing, running, return_exceptions=True)

    asyncio.run(scenario())


def test_what_is_behind_by_its_age_or_for_an_unknown_time_is_said_and_what_is_in_time_is_not(site):
    configuration = site(alarm_after_s=60.0)
    home, now_ms = configuration.home, time.time_ns() // 1_000_000
    of = OutboxMonitor(configuration.outbox, home)

    def trouble(**values):
        usual = {"connected": False, "told": 0, "refused": 0, "waiting": 0, "oldest_utc_ms": None, "error": AWAY}
        write_status(outbox_folder(home), {"postgresql": DestinationStatus(**dict[str, Any]({**usual, **values}))})
        return of.alarm_detail()

    assert of.alarm_detail() is None, "it has just started"
    assert trouble(away_since_utc_ms=now_ms - 3_600_000) is None, "away, and nothing to publish"
    assert trouble(waiting=3, oldest_utc_ms=now_ms - 30_000) is None
    assert messages.WAITING.id in ids(trouble(waiting=3, oldest_utc_ms=now_ms - 90_000))
    unknown = trouble(waiting=None, away_since_utc_ms=now_ms - 90_000)
    assert unknown is not None
    assert messages.WAITING_UNKNOWN.id in ids(unknown)
    assert unknown.parameters["error"] == AWAY
    assert trouble(waiting=3, oldest_utc_ms=now_ms + 3_600_000) is None, "the clock was set back"


def test_a_process_that_says_nothing_any_more_is_an_alarm_too(site, monkeypatch):
    configuration = site()
    status = DestinationStatus(connected=True, told=1, refused=0, waiting=0, oldest_utc_ms=None, error=None)
    write_status(outbox_folder(configuration.home), {"postgresql": status})
    of = OutboxMonitor(configuration.outbox, configuration.home)
    assert of.alarm_detail() is None
    monkeypatch.setattr(lag, "LOST_S", -1.0)
    assert messages.SILENT.id in ids(of.alarm_detail())


@pytest.mark.parametrize("step_ms", [-3_600_000, 3_600_000])
def test_a_stepped_clock_neither_hides_a_lost_process_nor_makes_one(site, monkeypatch, step_ms):
    configuration = site()
    folder, now_s, clock_ms = outbox_folder(configuration.home), 100.0, time.time_ns() // 1_000_000
    clocks = SimpleNamespace(monotonic=lambda: now_s, time=lambda: clock_ms / 1000)
    monkeypatch.setattr(lag, "time", clocks)
    monkeypatch.setattr("station.outbox.status.utc_ms", lambda: clock_ms)
    status = DestinationStatus(connected=True, told=1, refused=0, waiting=0, oldest_utc_ms=None, error=None)
    monitor = OutboxMonitor(configuration.outbox, configuration.home)
    now_s, clock_ms = now_s + lag.LOST_S, clock_ms + 30_000
    write_status(folder, {"postgresql": status})
    assert monitor.alarm_detail() is None
    now_s, clock_ms = now_s + 1, clock_ms + 1_000 + step_ms
    assert monitor.alarm_detail() is None, "it reported a second ago"
    now_s, clock_ms = now_s + lag.LOST_S, clock_ms + 30_000
    assert messages.SILENT.id in ids(monitor.alarm_detail())
    write_status(folder, {"postgresql": status})
    assert monitor.alarm_detail() is None, "it reports again"


def test_the_status_command_reports_a_lost_process_after_the_clock_was_set_back(site, tmp_path, monkeypatch):
    configuration = site()
    status = DestinationStatus(connected=True, told=1, refused=0, waiting=0, oldest_utc_ms=None, error=None)
    with monkeypatch.context() as patch:
        patch.setattr("station.outbox.status.utc_ms", lambda: utc_ms() + 3_600_000)
        write_status(outbox_folder(configuration.home), {"postgresql": status})
    code, text = call("outbox", "status", "--config", tmp_path / "station.yaml")
    assert code == 1
    assert text.startswith("the outbox was last heard 3")
