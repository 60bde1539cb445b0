"""`station alarms` against a running station: seen, acknowledged, hidden for a time, shown again, and who did it."""

import asyncio
import time

import pytest

from station.channel.line import CommandDone, CommandName, Line, StationState
from station.channel.messages import RefusedError
from station.channel.panel import AcknowledgeAlarm, AlarmList, ListAlarms, ShelveAlarm
from station.inspection.alarm_table import ALARMS, AlarmId
from station.messages import alarm_commands as messages
from station.runtime.production import housekeeping
from tests.command_line import call

BIT = 1 << (ALARMS[AlarmId.NO_RECIPE].number - 1)


@pytest.fixture
def alarms(tmp_path):
    """Run a command as a person would; return its exit code and its output."""

    async def beside(*arguments):
        return await asyncio.to_thread(call, *arguments, "--config", tmp_path / "station.yaml")

    return beside


def test_a_person_sees_acknowledges_and_shelves_an_alarm_and_the_trail_tells_who(bench, alarms):
    async def scenario():
        async with bench() as cell:

            async def word():
                return (await cell.line.state()).alarms & BIT

            await cell.line.order(CommandName.RESET)
            async with asyncio.timeout(60):
                while not await word():
                    await asyncio.sleep(0.05)
            code, output = await alarms("alarms", "list")
            assert code == 0
            assert "no_recipe (medium, unacknowledged) since 20" in output
            assert str(ALARMS[AlarmId.NO_RECIPE].action) in output
            for _ in range(2):
                assert await alarms("alarms", "acknowledge", "no_recipe", "--by", "Ida") == (
                    0,
                    "no_recipe is acknowledged\n",
                )
            shelve = ("alarms", "shelve", "no_recipe", "--minutes", "30", "--by", "Ida", "--reason", "cleaning")
            assert await alarms(*shelve) == (0, "no_recipe is shelved for 30 min\n")
            assert not await word(), "the PLC does not see it either"
            code, output = await alarms(*shelve)
            assert (code, "shelved until" in output, "by Ida" in output) == (1, True, True)
            assert "no_recipe (medium) is shelved until 20" in (await alarms("alarms", "list"))[1]
            assert (await alarms("alarms", "unshelve", "no_recipe", "--by", "Bo"))[0] == 0
            assert await word()
            records = cell.station.service.registry.records
            async with asyncio.timeout(60):
                while "alarm.unshelved" not in (rows := (await alarms("audit", "show", "--action", "alarm."))[1]):
                    await asyncio.sleep(0.1)
            assert rows.count("alarm.acknowledged") == 1, "what changes nothing is no row"
            assert "cleaning" in rows
            assert "Ida" in rows
            assert "Bo" in rows
            assert records.status().failures == {}

    asyncio.run(scenario())


def test_no_recipe_is_an_alarm_only_once_the_line_wants_inspections(bench, monkeypatch):
    monkeypatch.setattr(housekeeping, "_RECIPE_WITHIN_S", 1.0)

    async def scenario():
        async with bench() as cell:

            async def word(*, enabled):
                line = Line(plc_connected=True, plc_alive=True, enabled=enabled, waiting=0, counters={}, faults=())
                return (await cell.line.client.request(line, StationState, deadline_s=20)).alarms & BIT

            await cell.line.order(CommandName.RESET)
            until_s = time.monotonic() + 4.0
            while time.monotonic() < until_s:
                assert not await word(enabled=False), "a normal start is no alarm"
                await asyncio.sleep(0.1)
            async with asyncio.timeout(60):
                while not await word(enabled=True):
                    await asyncio.sleep(0.05)

    asyncio.run(scenario())


def test_what_cannot_be_done_to_an_alarm_is_refused_and_said(bench):
    async def scenario():
        async with bench() as cell:
            client = cell.line.client

            async def shelve(alarm="disk_low", who="Ida", reason="why", for_s=60.0):
                request = ShelveAlarm(alarm=alarm, who=who, role="operator", reason=reason, for_s=for_s)
                return await client.request(request, CommandDone, deadline_s=20)

            assert (await shelve("protective_stop")).why == messages.LATCHED(alarm="protective_stop")
            assert (await shelve(reason=" ")).why == messages.REASON_NEEDED()
            assert (await shelve(for_s=28801.0)).why == messages.TOO_LONG(asked_s=28801.0, limit_s=28800.0)
            with pytest.raises(RefusedError, match="moon"):
                await shelve(alarm="moon")
            with pytest.raises(RefusedError, match="audit: who"):
                await shelve(who="a\nb")
            request = AcknowledgeAlarm(alarm="disk_low", who="Ida", role="operator")
            done = await client.request(request, CommandDone, deadline_s=20)
            assert done.why == messages.NORMAL(alarm="disk_low")
            assert (await shelve()).done, "also one whose cause is not there yet"
            listed = await client.request(ListAlarms(), AlarmList, deadline_s=20)
            (hidden,) = [each for each in listed.alarms if each.alarm == "disk_low"]
            assert (hidden.state, hidden.active, hidden.shelved_by) == ("shelved_normal", False, "Ida")
            assert hidden.document == "docs/alarms.md#disk-low"

    asyncio.run(scenario())


def test_without_a_station_it_is_said(alarms, settings_file):
    settings_file()

    async def scenario():
        code, output = await alarms("alarms", "list")
        assert code == 1
        assert "did not answer ListAlarms within 5 s; alarms are a running station's" in output

    asyncio.run(scenario())
