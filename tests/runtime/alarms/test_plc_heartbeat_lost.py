"""A PLC that was enabled and goes, at the real interface: the alarm, the readiness, and the return to normal."""

import asyncio
import json
import urllib.error
import urllib.request

import pytest

from plc_interface.client import StationClient
from station.channel.line import CommandName, Line, StationState
from station.inspection.alarm_table import ALARMS, AlarmId
from station.runtime.production import housekeeping

NUMBER = ALARMS[AlarmId.PLC_HEARTBEAT_LOST].number
AGE = 'station_link_age_seconds{link="plc"}'
BEATS = 10
"""Of the station, in which it has evaluated its alarms anew."""


def plc_health(port):
    """Return the PLC's state as `/readyz` reports it, whether the station is ready or not."""
    try:
        answer = urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=20)
    except urllib.error.HTTPError as error:
        answer = error
    with answer:
        return next(part for part in json.load(answer)["dependencies"] if part["name"] == "plc")["state"]


def plc_age_s(port):
    """Time since the PLC was heard, as an alert reads it."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=20) as page:
        [line] = [each for each in page.read().decode().splitlines() if each.startswith(AGE)]
    return float(line.split()[-1])


@pytest.mark.parametrize("connected", [True, False])
def test_a_plc_is_missed_once_its_enable_was_withdrawn_and_not_before_its_first_beat(bench, monkeypatch, connected):
    monkeypatch.setattr(housekeeping, "_RECIPE_WITHIN_S", 0.5)

    async def scenario():
        async with bench() as cell:

            async def until(alarm, **values):
                line = Line(plc_alive=False, waiting=0, counters={}, faults=(), **values)
                async with asyncio.timeout(60):
                    while True:
                        word = (await cell.line.client.request(line, StationState, deadline_s=20)).alarms
                        if word & 1 << ALARMS[alarm].number - 1:
                            return bool(word & 1 << NUMBER - 1)
                        await asyncio.sleep(0.05)

            await cell.line.order(CommandName.RESET)
            unheard_s = await asyncio.to_thread(plc_age_s, cell.configuration.metrics.port)
            assert not await until(AlarmId.NO_RECIPE, enabled=True, plc_connected=True), (
                "the enabled line was evaluated, and is not missed"
            )
            assert await asyncio.to_thread(plc_age_s, cell.configuration.metrics.port) < unheard_s
            lost = {"enabled": False, "enable_withdrawn": True, "plc_connected": connected}
            assert await until(AlarmId.PLC_HEARTBEAT_LOST, **lost)

    asyncio.run(scenario())


def test_a_plc_that_goes_while_it_is_enabled_is_an_alarm_until_it_beats_again(bench, plc_port, settings_file):
    async def scenario():
        file = settings_file()
        async with bench(file) as cell, plc_port(file) as port, StationClient("127.0.0.1", port) as reader:
            metrics_port = cell.configuration.metrics.port

            async def reported(*, lost):
                async with asyncio.timeout(60):
                    while (NUMBER in await reader.alarms()) is not lost:
                        await asyncio.sleep(0.05)
                return await asyncio.to_thread(plc_health, metrics_port)

            async with StationClient("127.0.0.1", port, timeout_s=10) as plc:
                await plc.arm()
                assert await reported(lost=False) == "ok"
            assert await reported(lost=True) == "fault"
            async with StationClient("127.0.0.1", port, timeout_s=10) as plc:
                await plc.arm()
                assert await reported(lost=False) == "ok"
                await plc.disarm()
            released = int(await reader.read("station_heartbeat"))
            async with asyncio.timeout(60):
                while (int(await reader.read("station_heartbeat")) - released) % 2**16 < BEATS:
                    await asyncio.sleep(0.05)
            assert "writer_owned" not in await reader.status()
            assert await reported(lost=False) == "ok"

    asyncio.run(scenario())
