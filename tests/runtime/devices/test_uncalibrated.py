"""A unit without a calibration takes no fruit, and reports what to do; it goes on by itself once it has one."""

import asyncio
import time

import pytest

from plc_interface.registers.map import BY_NAME
from station.commands.simulated_unit import calibrate_simulated_unit
from station.inspection.alarm_table import ALARMS, AlarmId
from station.inspection.states import State
from station.messages import calibration
from station.records.database import reading
from station.records.search import Query, find_page
from station.settings.configuration import Configuration
from tests.stored_inspection import read_record

NUMBER = ALARMS[AlarmId.CALIBRATION_OLD].number
TRIGGER_AND_ENABLE = 3


async def until(holds, plc, cell):
    """Wait until something holds; a failure reports the state of PLC and station meanwhile."""
    deadline_s = time.monotonic() + 90
    while not await holds():
        assert time.monotonic() < deadline_s, (
            f"{holds.__name__}: {await plc.status()}, alarm {await plc.read('error_code')}, {cell.phase}, "
            f"{(await cell.line.state()).why_not_ready}"
        )
        await asyncio.sleep(0.02)


@pytest.mark.timeout(300)
def test_triggers_are_refused_with_the_remedy_until_the_sensor_is_calibrated(bench, plc_interface, tmp_path):
    async def scenario():
        async with bench(uncalibrated="refuse") as cell, plc_interface(tmp_path / "station.yaml") as plc:
            await cell.choose("blueberry")
            await cell.reach(State.IDLE)

            async def refused():
                await plc.write({"control": TRIGGER_AND_ENABLE, "trigger_id": 7})
                return "trigger_acknowledged" in await plc.status()

            async def alarmed():
                return await plc.read("error_code") == NUMBER

            await until(refused, plc, cell)
            await until(alarmed, plc, cell)
            shown = await plc.scan()
            assert BY_NAME["last_refusal"].codes[shown["last_refusal"]].name == "not_ready"
            assert shown["accepted_trigger_id"] != 7
            state = await cell.line.state()
            assert state.why_not_ready == calibration.REQUIRED()
            with reading(cell.station.service.registry.records.folder) as connection:
                assert find_page(connection, Query()).rows == (), "nothing was started or lost"

            await plc.write({"control": 1})
            shipped = cell.configuration.model_copy(update={"recipes_folder": Configuration().recipes_folder})
            made = await asyncio.to_thread(calibrate_simulated_unit, shipped, "anna")
            assert made is not None

            async def ready():
                return "trigger_ready" in await plc.status() and await plc.read("error_code") == 0

            await until(ready, plc, cell)
            result = await plc.inspect(8, deadline_s=90)
            record = read_record(cell.station.service.registry.records, result.sequence)
            assert made.id in record.judged.devices["calibration"]
            assert "uncalibrated" not in record.judged.measures

    asyncio.run(scenario())


@pytest.mark.timeout(180)
def test_where_it_is_allowed_each_record_states_it(bench):
    async def scenario():
        async with bench(uncalibrated="allow") as cell:
            await cell.choose("blueberry")
            outcome = await cell.line.inspect()
            record = read_record(cell.station.service.registry.records, outcome.sequence)
            assert record.judged.measures["uncalibrated"] == "allow"
            assert record.judged.devices["calibration"].endswith("inspecting is allowed by service.uncalibrated")
            assert cell.station.service.alarms.alarms.get(AlarmId.CALIBRATION_OLD).state == "normal"

    asyncio.run(scenario())
