"""The mode over a restart: in another than production nothing moves by itself, also in a station that starts anew."""

import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.client import ChannelClient
from station.channel.line import CommandName
from station.channel.panel_run import OperatorCommandName
from station.inspection.states import State
from station.messages import commands, readiness
from station.messages.calibration import A_CALIBRATION
from station.runtime.cycle.service import Service
from station.runtime.devices.manager import GRIPPER
from station.runtime.production import plc_commands
from station.runtime.production.housekeeping import Housekeeping
from station.runtime.production.plc_commands import MANUAL, PRODUCTION, PlcCommands
from station.settings.hmi import panel_endpoint
from station.state_files import StateFiles
from station.vocabulary import Refusal
from tests.runtime.ball import give


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
def test_a_station_killed_in_manual_mode_moves_nothing_until_a_person_resets_it(
    bench, settings_file, entered, monkeypatch
):
    file, rounds, recover = settings_file(bench=False), list[list[str]](), Housekeeping._try_recovery

    async def counted(self):
        await recover(self)
        rounds.append(list(self._devices.faults))

    monkeypatch.setattr(Housekeeping, "_try_recovery", counted)

    async def scenario():
        async with bench(file) as cell:
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
        entered.clear()
        rounds.clear()
        async with bench(file) as cell:
            # A gripper that is not activated, and nothing else: in production its jaws would open at once.
            await cell.until(lambda: rounds.count([GRIPPER]) > 3, patience_s=150)
            assert rounds[-1] == [GRIPPER]
            assert set(entered) <= {State.UNKNOWN, State.HELD}
            assert (await cell.line.state()).mode == MANUAL
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            done = await cell.line.order(CommandName.RESET)
            assert done.done, done.why
            assert cell.phase is State.IDLE
        async with bench(file) as cell:
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)

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


async def hold_with_a_cut_arm(cell):
    """Have the station hold a fruit that it has begun to close on: the link to its arm is cut."""
    await cell.choose("blueberry")
    await cell.line.ready()
    await cell.line.begin()
    await cell.reach(State.CLOSING_TO_ONSET)
    cell.twin.boards["arm"].set("link_cut")
    await cell.reach(State.HELD)


def panel_of(cell):
    """Connect to the station as the pages do."""
    return ChannelClient(panel_endpoint(cell.configuration.hmi, cell.configuration.home), "the station")


@pytest.mark.timeout(240)
def test_manual_mode_by_a_person_stops_the_station_until_a_persons_start_whatever_mode_the_plc_sets(bench):
    async def scenario():
        async with bench() as cell, panel_of(cell) as panel:
            await cell.choose("blueberry")
            await cell.line.ready()
            manual = await give(panel, OperatorCommandName.SET_MODE, str(MANUAL))
            assert (manual.state, cell.phase) == ("done", State.STOPPED)
            assert (await cell.line.state()).mode == MANUAL
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            assert (await cell.line.begin()).refusal is Refusal.NOT_READY
            reset = await cell.line.order(CommandName.RESET)
            assert (reset.done, reset.why) == (False, readiness.STOPPED_BY_PERSON())
            assert (cell.configuration.home / "stopped_by_a_person").read_text() == "yes"
            assert (await give(panel, OperatorCommandName.START)).state == "done"
            assert (await cell.line.ready()).mode == PRODUCTION

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_manual_mode_that_still_waits_for_the_arm_is_not_set_after_a_persons_start(bench):
    async def scenario():
        async with bench(bench=False) as cell, panel_of(cell) as panel:
            await cell.choose("blueberry")
            await cell.line.ready()
            cell.at(State.RETREATING_READY, lambda: cell.twin.boards["arm"].set("slow", 100.0))
            await cell.line.begin()
            await cell.reach(State.RETREATING_READY)
            manual = asyncio.create_task(give(panel, OperatorCommandName.SET_MODE, str(MANUAL)))
            await cell.until(lambda: cell.station.service.stopped_by_person)
            assert (await give(panel, OperatorCommandName.START)).state == "done"
            assert (await manual).why == commands.STARTED_MEANWHILE()
            cell.twin.boards["arm"].clear()
            assert (await cell.line.ready()).mode == PRODUCTION

    asyncio.run(scenario())


@pytest.mark.timeout(240)
@pytest.mark.parametrize("mode", [2, MANUAL])
def test_another_mode_is_set_once_an_arm_that_went_home_by_itself_is_at_rest(bench, mode):
    async def scenario():
        async with bench(bench=False) as cell:
            await hold_with_a_cut_arm(cell)
            cell.twin.boards["arm"].set("slow", 100.0)
            cell.twin.boards["arm"].clear("link_cut")
            await cell.reach(State.HOMING)
            arm = cell.station.service._devices.cell.arm

            async def moving():
                return (await arm.state()).moving

            await cell.until(moving)
            done = await cell.line.order(CommandName.SET_MODE, mode)
            assert done.done, done.why
            assert (cell.phase, await moving()) == (State.STOPPED, False)
            assert (await arm.state()).at not in {"above_nest", "home"}
            cell.twin.boards["arm"].clear()
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            assert (await cell.line.order(CommandName.RESET)).done
            await cell.line.ready()

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_manual_mode_that_the_plc_has_set_is_a_stop_for_the_person_who_orders_it_too(bench):
    async def scenario():
        async with bench() as cell, panel_of(cell) as panel:
            await cell.choose("blueberry")
            await cell.line.ready()
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            manual = await give(panel, OperatorCommandName.SET_MODE, str(MANUAL))
            assert (manual.state, cell.phase) == ("done", State.STOPPED)
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            assert (await cell.line.begin()).refusal is Refusal.NOT_READY

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_reset_in_manual_mode_that_is_not_done_in_time_leaves_the_arm_at_rest(bench, monkeypatch):
    async def scenario():
        async with bench(bench=False) as cell:
            await hold_with_a_cut_arm(cell)
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            cell.twin.boards["arm"].set("slow", 100.0)
            cell.twin.boards["arm"].clear("link_cut")
            await cell.reach(State.STOPPED)
            monkeypatch.setattr(plc_commands, "DEADLINE_S", 5.0)
            done = await cell.line.order(CommandName.RESET)
            assert (done.done, done.why and done.why.id) == (False, commands.TOO_SLOW.id)
            arm = cell.station.service._devices.cell.arm
            assert (cell.phase, (await arm.state()).moving) == (State.STOPPED, False)
            cell.twin.boards["arm"].clear()

    asyncio.run(scenario())


def test_the_mode_that_is_set_already_ends_no_activation_of_a_manual_activity(tmp_path):
    """Its own activation has the lock of a recovery, which would be stopped."""
    ended = list[str]()

    async def end_recovery():
        ended.append("recovery")

    async def noted():
        return True

    service: Any = SimpleNamespace(
        manual_activity=A_CALIBRATION(),
        makes_itself_ready=False,
        set_mode=lambda **_: None,
        state=State.STOPPED,
    )
    devices: Any = SimpleNamespace(end_recovery=end_recovery, light_by_hand=False)
    none: Any = None
    orders = PlcCommands(service, devices, none, none, StateFiles(tmp_path), none)
    orders.mode, orders._store_mode = MANUAL, noted
    assert asyncio.run(orders._set_mode(MANUAL)) is None
    assert not ended
    service.manual_activity = None
    assert asyncio.run(orders._set_mode(PRODUCTION)) is None
    assert ended == ["recovery"]


@pytest.mark.timeout(240)
def test_the_last_mode_is_what_the_file_has_also_where_the_disk_outlasts_the_order_before(bench, monkeypatch):
    started, free, ended, write = threading.Event(), threading.Event(), threading.Event(), StateFiles.write

    def slow_once(self, name, data):
        if name != "mode" or started.is_set():
            return write(self, name, data)
        started.set()
        assert free.wait(60)
        written = write(self, name, data)
        ended.set()
        return written

    async def scenario():
        async with bench() as cell:
            home = cell.configuration.home
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            monkeypatch.setattr(StateFiles, "write", slow_once)
            monkeypatch.setattr(plc_commands, "DEADLINE_S", 0.3)
            assert not (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            assert started.is_set()
            monkeypatch.setattr(plc_commands, "DEADLINE_S", 25.0)
            manual = asyncio.create_task(cell.line.order(CommandName.SET_MODE, MANUAL))
            await cell.until(lambda: not cell.station.service._in_production)
            free.set()
            done = await manual
            assert done.done, done.why
            assert await asyncio.to_thread(ended.wait, 60)
            assert (home / "mode").read_text() == str(MANUAL)

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


@pytest.mark.parametrize(
    ("stop", "stopped"),
    [(None, False), (b"no", False), (b"yes", True), (b"", True), (b"\0\0\0", True), ("a folder", True)],
)
@pytest.mark.parametrize("mode", [None, "a folder"])
def test_files_of_stop_and_mode_that_cannot_be_read_stop_the_station_in_manual_mode(tmp_path, stop, stopped, mode):
    for name, content in {"stopped_by_a_person": stop, "mode": mode}.items():
        if content == "a folder":
            (tmp_path / name).mkdir()
        elif content is not None:
            (tmp_path / name).write_bytes(content)
    stops, productions = list[str](), list[bool]()
    service: Any = SimpleNamespace(
        stop=lambda: stops.append("stop"), set_mode=lambda *, production: productions.append(production)
    )
    none: Any = None
    orders = PlcCommands(service, none, none, none, StateFiles(tmp_path), none)
    orders.restore()
    assert bool(stops) == stopped
    assert (orders.mode, productions) == ((PRODUCTION, []) if mode is None else (MANUAL, [False]))
