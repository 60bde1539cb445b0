"""A unit without a calibration takes no fruit, and reports what to do; it goes on by itself once it has one."""

import asyncio
import contextlib
import time

import pytest

from plc_interface.registers.map import BY_NAME
from station.channel.client import ChannelClient
from station.channel.line import CommandName
from station.channel.messages import RefusedError
from station.channel.panel_maintenance import CalibrationState, NoteGelChange
from station.commands.simulated_unit import calibrate_simulated_unit
from station.inspection.alarm_table import ALARMS, AlarmId
from station.inspection.states import State
from station.messages import calibration, maintenance
from station.records.audit_report import read_audit
from station.records.database import reading
from station.records.search import Query, find_page
from station.runtime.imaging.golden_reference import GOLDEN
from station.runtime.production.plc_commands import MANUAL, PRODUCTION
from station.settings.configuration import Configuration
from station.settings.hmi import panel_endpoint
from tests.runtime.ball import MAX
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


async def calibrate(cell):
    """Make a calibration where none is in force."""
    shipped = cell.configuration.model_copy(update={"recipes_folder": Configuration().recipes_folder})
    made = await asyncio.to_thread(calibrate_simulated_unit, shipped, "anna")
    assert made is not None
    return made


@contextlib.asynccontextmanager
async def panel_of(cell):
    """Send the order of the panel's button."""
    async with ChannelClient(panel_endpoint(cell.configuration.hmi, cell.configuration.home), "the station") as panel:

        async def note_gel_change():
            return await panel.request(NoteGelChange(actor=MAX), CalibrationState, deadline_s=20)

        yield note_gel_change


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
            made = await calibrate(cell)

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


@pytest.mark.timeout(300)
def test_after_a_changed_gel_triggers_are_refused_until_the_sensor_is_calibrated_again(bench, plc_interface, tmp_path):
    async def scenario():
        async with (
            bench(uncalibrated="refuse") as cell,
            plc_interface(tmp_path / "station.yaml") as plc,
            panel_of(cell) as note_gel_change,
        ):
            old = await calibrate(cell)
            await cell.choose("blueberry")
            await cell.line.ready()
            golden = cell.configuration.home / GOLDEN
            golden.write_bytes(b"of the old gel")
            with pytest.raises(RefusedError) as refused:
                await note_gel_change()
            assert refused.value.message == maintenance.SET_MANUAL(mode=PRODUCTION, manual=MANUAL)
            assert golden.exists()

            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            shown = await note_gel_change()
            assert shown.calibration is None
            assert "gel was changed" in str(shown.trouble)
            assert not golden.exists()
            with reading(cell.configuration.home / "records") as connection:
                [row] = read_audit(connection, 9, "calibration.gel_changed", "")
            assert (row.who, row.role, row.old) == ("Max", "maintenance", f'"{old.id}"')
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done

            async def is_refused():
                await plc.write({"control": TRIGGER_AND_ENABLE, "trigger_id": 7})
                return "trigger_acknowledged" in await plc.status() and await plc.read("error_code") == NUMBER

            await until(is_refused, plc, cell)
            why = (await cell.line.state()).why_not_ready
            assert "Max): calibrate it with the ball" in str(why)
            assert (await plc.scan())["accepted_trigger_id"] != 7

            await plc.write({"control": 1})
            new = await calibrate(cell)

            async def ready():
                return "trigger_ready" in await plc.status() and await plc.read("error_code") == 0

            await until(ready, plc, cell)
            result = await plc.inspect(8, deadline_s=90)
            record = read_record(cell.station.service.registry.records, result.sequence)
            assert new.id in record.judged.devices["calibration"]

    asyncio.run(scenario())


@pytest.mark.timeout(180)
def test_where_it_is_allowed_a_changed_gel_gets_a_golden_reference_of_its_own(bench):
    async def scenario():
        async with bench(uncalibrated="allow") as cell, panel_of(cell) as note_gel_change:
            await cell.choose("blueberry")
            await cell.line.inspect()
            golden = cell.configuration.home / GOLDEN
            golden.write_bytes(of_old_gel := golden.read_bytes() + b"\0")
            await cell.reach(State.IDLE)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            await note_gel_change()
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            await cell.line.inspect()
            assert golden.read_bytes() != of_old_gel

    asyncio.run(scenario())
