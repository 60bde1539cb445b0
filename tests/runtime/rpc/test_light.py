"""The sensor's light that a person sets by hand: fruit and ball are measured in the configuration's."""

import asyncio
import json

import pytest

from station.channel.client import ChannelClient
from station.channel.line import CommandName
from station.channel.panel_maintenance import LedsSet, SetLeds
from station.inspection.states import State
from station.runtime.production.plc_commands import MANUAL, PRODUCTION
from station.settings.hmi import panel_endpoint
from tests.runtime.ball import MAX, end_run, start_run


async def set_light(cell, panel):
    await panel.request(SetLeds(red=5, green=0, blue=10, actor=MAX), LedsSet, deadline_s=20)
    assert cell.twin.camera._leds == (5, 0, 10)


def test_the_end_of_manual_mode_restores_the_configurations_light(bench, settings_file):
    file = settings_file()
    values = json.loads(file.read_text())
    values["camera"]["digit"] = {"red": 12}
    file.write_text(json.dumps(values))

    async def scenario():
        async with bench(file) as cell:
            await cell.choose("blueberry")
            await cell.reach(State.IDLE)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            endpoint = panel_endpoint(cell.configuration.hmi, cell.configuration.home)
            async with ChannelClient(endpoint, "the station") as panel:
                await set_light(cell, panel)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            assert cell.twin.camera._leds == (5, 0, 10)
            cell.twin.boards["camera"].set("off")
            refused = await cell.line.order(CommandName.SET_MODE, PRODUCTION)
            assert not refused.done, "no fruit is measured in this light"
            cell.twin.boards["camera"].clear()
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            assert cell.twin.camera._leds == (12, 15, 15)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_calibration_restores_the_configurations_light(at_ball):
    async def scenario():
        async with at_ball() as (cell, panel, _):
            await set_light(cell, panel)
            await start_run(panel, ())
            await cell.until(lambda: cell.twin.camera._leds == (15, 15, 15))
            await end_run(panel)

    asyncio.run(scenario())
