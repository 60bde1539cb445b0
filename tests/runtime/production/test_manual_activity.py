"""While a person calibrates in manual mode, nothing but the procedure moves: no reset, by whomever or by itself."""

import asyncio
import threading

import pytest

from station.channel.line import CommandName
from station.channel.panel_maintenance import CalibrationState, GetCalibration, Jogged, JogGripper
from station.channel.panel_run import GetPanelState, OperatorCommandName, PanelState
from station.devices.gripper.errors import GripperStoppedError
from station.errors import StationError
from station.inspection.states import State
from station.messages.calibration import A_CALIBRATION, STEP_PRESS
from station.messages.commands import JOGGING, TOO_SLOW
from station.messages.gripper import JAWS_UNKNOWN, REMEDY_STOPPED, STOPPED
from station.messages.maintenance import UNDER_WAY
from station.press.reference import are_open
from station.runtime.devices.calibration_rig import CalibrationRig
from station.runtime.devices.manager import CAMERA, GRIPPER, DeviceManager
from station.runtime.production import plc_commands
from station.runtime.production.plc_commands import MANUAL, PRODUCTION
from station.state_files import StateFiles
from tests.runtime.ball import MAX, end_run, give, run_now, start_run, stop, until_waits


@pytest.mark.timeout(500)
def test_a_reset_while_the_ball_is_pressed_is_refused_and_moves_nothing(at_ball):
    async def scenario():
        async with at_ball(bench=False) as (cell, panel, entered):
            await stop(panel)
            await start_run(panel)

            async def pressed():
                return any(step.title == STEP_PRESS() for step in (await run_now(panel)).steps)

            await cell.until(pressed)
            refused = await cell.line.order(CommandName.RESET)
            assert (refused.done, refused.why) == (False, UNDER_WAY(activity=A_CALIBRATION()))
            state = await panel.request(GetPanelState(), PanelState, deadline_s=20)
            assert OperatorCommandName.START not in state.may
            assert cell.station.service.stopped_by_person, "the person's stop is still in force"
            await until_waits(cell, panel)
            assert entered == [State.STOPPED]
            assert (await end_run(panel)).state == "ended"
            started = await give(panel, OperatorCommandName.START)
            assert started.state == "done", started.why
            assert cell.phase is State.IDLE

    asyncio.run(scenario())


@pytest.mark.timeout(500)
def test_a_link_that_returns_during_a_run_moves_nothing_before_a_person_resets(at_ball):
    """The run was started without a *Stop*."""

    async def scenario():
        async with at_ball(bench=False) as (cell, panel, entered):
            await start_run(panel)
            await until_waits(cell, panel)
            monitors = cell.station.service._devices.monitors
            heard_s = monitors[CAMERA].heard_s, monitors[GRIPPER].heard_s
            cell.twin.boards["arm"].set("link_cut")
            await cell.until(lambda: cell.phase is State.HELD)
            cell.twin.boards["arm"].clear()
            await cell.until(lambda: not cell.station.service._devices.faults)
            assert (await run_now(panel)).state == "waiting"
            assert entered == [State.HELD]
            assert (monitors[CAMERA].heard_s, monitors[GRIPPER].heard_s) == heard_s, "they are the procedure's"
            await end_run(panel)
            await cell.until(lambda: State.STOPPED in entered)
            await cell.station.service.runner.taken()
            assert entered[-1] is State.STOPPED
            assert (await cell.line.order(CommandName.SET_MODE, 1)).done
            await cell.station.service.runner.taken()
            assert entered[-1] is State.STOPPED, "a mode is no reset"
            done = await cell.line.order(CommandName.RESET)
            assert done.done, done.why
            assert cell.phase is State.IDLE

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_in_manual_mode_a_reset_waits_for_a_lost_device_and_the_mode_takes_it_back(at_ball):
    async def scenario():
        async with at_ball() as (cell, _, _):
            camera, service = cell.twin.boards["camera"], cell.station.service
            camera.set("off")
            await cell.until(lambda: cell.phase is State.HELD)
            reset = asyncio.create_task(cell.line.order(CommandName.RESET))
            await cell.until(lambda: service.makes_itself_ready)
            camera.clear()
            done = await reset
            assert done.done, done.why
            assert cell.phase is State.IDLE

            camera.set("off")
            await cell.until(lambda: cell.phase is State.HELD)
            service.request_reset()
            assert service.makes_itself_ready
            assert (await cell.line.order(CommandName.SET_MODE, MANUAL)).done
            assert not service.makes_itself_ready

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_reset_that_failed_in_manual_mode_moves_nothing_once_the_device_is_back(at_ball, monkeypatch):
    async def scenario():
        async with at_ball() as (cell, _, entered):
            camera, gripper = cell.twin.boards["camera"], cell.twin.boards["gripper"]

            def faults():
                return cell.station.service._devices.faults

            async def fails():
                with monkeypatch.context() as impatient:
                    impatient.setattr(plc_commands, "DEADLINE_S", 0.5)
                    return (await cell.line.order(CommandName.RESET)).why.id == TOO_SLOW.id

            camera.set("off")
            await cell.until(lambda: cell.phase is State.HELD)
            assert await fails()
            camera.clear()
            await cell.until(lambda: State.STOPPED in entered)
            await cell.station.service.runner.taken()
            assert entered[-1] is State.STOPPED
            assert (await cell.line.order(CommandName.RESET)).done

            camera.set("off")
            gripper.set("power_cut")
            gripper.clear()
            await cell.until(lambda: set(faults()) == {CAMERA, GRIPPER})
            assert await fails()
            camera.clear()
            assert (await cell.line.order(CommandName.SET_MODE, PRODUCTION)).done
            # The confirmation of the jaws has ended with the reset: no activation closes them.
            await cell.until(lambda: GRIPPER in faults() and faults()[GRIPPER].cause == JAWS_UNKNOWN())
            assert (await cell.line.order(CommandName.RESET)).done

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_manual_mode_that_is_ordered_again_at_the_panel_ends_no_run(at_ball):
    async def scenario():
        async with at_ball() as (_, panel, _):
            await start_run(panel)
            assert (await give(panel, OperatorCommandName.SET_MODE, str(MANUAL))).state == "done"
            assert (await run_now(panel)).state in {"running", "waiting"}
            await end_run(panel)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_no_run_begins_while_the_fingers_are_moved_by_hand(at_ball):
    async def scenario():
        async with at_ball() as (cell, panel, _):
            service = cell.station.service
            cell.twin.boards["gripper"].set("stuck")
            jog = JogGripper(to="width", width_mm=40.0, actor=MAX)
            jogging = asyncio.create_task(panel.request(jog, Jogged, deadline_s=60))
            await cell.until(lambda: service.manual_activity == JOGGING())
            seen = await panel.request(GetCalibration(), CalibrationState, deadline_s=20)
            assert seen.run_refused == UNDER_WAY(activity=JOGGING())
            await asyncio.gather(jogging, return_exceptions=True)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_reset_that_waited_for_the_disk_while_a_run_began_moves_nothing(at_ball, monkeypatch):
    started, written = threading.Event(), threading.Event()
    write = StateFiles.write

    def slow(self, name, data):
        started.set()
        assert written.wait(60)
        return write(self, name, data)

    async def scenario():
        async with at_ball() as (cell, panel, entered):
            await stop(panel)
            monkeypatch.setattr(StateFiles, "write", slow)
            starting = asyncio.create_task(give(panel, OperatorCommandName.START))
            await cell.until(started.is_set)
            await start_run(panel)
            written.set()
            assert (await starting).why == UNDER_WAY(activity=A_CALIBRATION())
            await cell.station.service.runner.taken()
            assert entered == [State.STOPPED]
            await end_run(panel)

    asyncio.run(scenario())


@pytest.mark.timeout(500)
def test_a_protective_stop_ends_a_press_where_the_jaws_are(at_ball):
    async def scenario():
        async with at_ball(bench=False) as (cell, panel, entered):
            await start_run(panel)

            async def pressed_twice():
                return any(step.title == STEP_PRESS() and step.number > 1 for step in (await run_now(panel)).steps)

            await cell.until(pressed_twice)
            cell.twin.boards["arm"].set("protective_stop")
            await cell.until(lambda: cell.phase is State.LATCHED)
            await cell.station.service.runner.taken()
            stopped_mm = cell.twin.world.opening_mm()

            async def over():
                return (await run_now(panel)).state != "running"

            await cell.until(over)
            assert (await run_now(panel)).state == "failed"
            assert cell.twin.world.opening_mm() == stopped_mm
            assert entered[-1] is State.LATCHED
            assert cell.station.service.manual_activity is None, "a person may confirm the stop"

    asyncio.run(scenario())


@pytest.mark.timeout(500)
def test_a_persons_stop_calls_a_run_off_and_is_done_once_the_jaws_are_open(at_ball):
    async def scenario():
        async with at_ball() as (cell, panel, entered):
            await start_run(panel)

            async def pressed():
                return any(step.title == STEP_PRESS() for step in (await run_now(panel)).steps)

            await cell.until(pressed)
            await stop(panel)
            assert (await run_now(panel)).state == "ended"
            gripper = cell.station.service._devices.cell.gripper
            assert are_open((await gripper.read()).width_mm, gripper.max_width_mm)
            assert entered == [State.STOPPED]

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_persons_stop_ends_a_jog(at_ball):
    async def scenario():
        async with at_ball() as (cell, panel, _):
            service = cell.station.service
            cell.twin.boards["gripper"].set("stuck")
            jog = JogGripper(to="width", width_mm=40.0, actor=MAX)
            jogging = asyncio.create_task(panel.request(jog, Jogged, deadline_s=60))
            await cell.until(lambda: service.manual_activity == JOGGING())
            await stop(panel)
            with pytest.raises(StationError) as ended:
                await jogging
            assert ended.value.message == GripperStoppedError(STOPPED(), REMEDY_STOPPED()).message

    asyncio.run(scenario())


@pytest.mark.timeout(500)
@pytest.mark.parametrize("stopped", [False, True])
def test_an_orderly_end_keeps_the_arm_alive_until_the_ball_is_released_and_the_arm_at_home(
    at_ball, monkeypatch, stopped
):
    release, close, left = CalibrationRig.release, DeviceManager.close, list[tuple[str | None, object]]()

    async def closed(self):
        state = await self._arm.state()
        left.append((state.at, state.fault))
        await close(self)

    async def scenario():
        monkeypatch.setattr(DeviceManager, "close", closed)
        async with at_ball(bench=False) as (cell, panel, entered):
            devices, renewals = cell.station.service._devices, list[None]()
            renew = devices.renew_health

            def renewed():
                renewals.append(None)
                renew()

            async def released(self, failed=None):
                await release(self, failed)
                renewals.clear()
                await cell.until(lambda: renewals, patience_s=15)

            if stopped:
                await stop(panel)
            await start_run(panel)

            async def pressed():
                return any(step.title == STEP_PRESS() for step in (await run_now(panel)).steps)

            await cell.until(pressed)
            monkeypatch.setattr(devices, "renew_health", renewed)
            monkeypatch.setattr(CalibrationRig, "release", released)
            cell.station.stop()
            await cell.running
            assert State.LATCHED not in entered

    asyncio.run(scenario())
    assert left == [("home", None)]
