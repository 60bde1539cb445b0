"""The mode over a restart: in another than production nothing moves by itself, also in a station that starts anew."""

import asyncio

import pytest

from station.channel.line import CommandName
from station.inspection.states import State
from station.messages import commands, readiness
from station.runtime.cycle.service import Service
from station.runtime.production.plc_commands import MANUAL, PRODUCTION
from station.runtime.state_files import StateFiles


@pytest.fixture
def entered(monkeypatch):
    """Each state that a station enters."""
    states, note = list[State](), Service.entered

    def noted(self, state, after, took_s):
        states.append(state)
        note(self, state, after, took_s)

    monkeypatch.setattr(Service, "entered", noted)
    return states


@pytest.mark.timeout(240)
def test_a_station_killed_in_manual_mode_moves_nothing_until_a_person_resets_it(bench, settings_file, entered):
    file = settings_file(bench=False)

    async def scenario():
        async with bench(file) as cell:
            await cell.reach(State.IDLE)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
        entered.clear()
        async with bench(file) as cell:
            await cell.reach(State.STOPPED)
            await cell.until(lambda: not cell.station.service._devices.faults)
            await cell.station.service.runner.taken()
            assert State.IDLE not in entered
            assert entered[-1] is State.STOPPED
            assert (await cell.line.state()).why_not_ready == readiness.NOT_PRODUCTION()
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            done = await cell.line.order(CommandName.RESET)
            assert done.done, done.why
            assert cell.phase is State.IDLE
        async with bench(file) as cell:
            await cell.reach(State.IDLE)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
@pytest.mark.parametrize(("stored", "mode"), [("1", PRODUCTION), ("2", 2), ("3", MANUAL), ("0", MANUAL), ("", MANUAL)])
def test_a_mode_that_nobody_can_read_is_manual(bench, settings_file, tmp_path, stored, mode):
    file = settings_file()
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "mode").write_text(stored)

    async def scenario():
        async with bench(file) as cell:
            assert (await cell.line.state()).mode == mode

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_mode_that_cannot_be_stored_is_set_and_said(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            monkeypatch.setattr(StateFiles, "write", lambda *_: False)
            done = await cell.line.order(CommandName.SET_MODE, MANUAL)
            assert (done.done, done.why) == (False, commands.MODE_NOT_STORED(mode=MANUAL))
            assert (await cell.line.state()).mode == MANUAL

    asyncio.run(scenario())
