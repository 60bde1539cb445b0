"""Options of a site: fruit placed by the arm, no reset by itself; and a disk that refuses in mid inspection."""

import asyncio
import resource
import traceback

import pytest

from station.channel.line import CommandDone, CommandName, PackmlState
from station.channel.panel import Recover
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperSilentError
from station.inspection.alarm_table import AlarmId
from station.inspection.states import State
from station.messages import arm as arm_messages
from station.messages import states
from station.messages.message import verbatim
from station.twin.ur.controller import UrController
from station.vocabulary import Reason

REACHED_RAD = 0.02


def forgive_nothing(now_s: float) -> None:
    """Do nothing, in place of `stood_still`: the controller's watchdog expires also where it has stood still itself."""


def active(cell):
    return {alarm.id for alarm in cell.station.service.alarms.alarms.active}


def places_of(cell):
    """The arm's places at which it is now."""
    [arm] = [server for server in cell.twin._servers if isinstance(server, UrController)]
    poses = cell.configuration.arm.poses
    places = {name: poses.joints_rad(name) for name in ("nest", "accept", "reject", "above_nest")}
    return [
        name
        for name, joints in places.items()
        if all(abs(a - b) < REACHED_RAD for a, b in zip(joints, arm.joints_rad, strict=True))
    ]


@pytest.mark.timeout(240)
def test_a_fruit_whose_outcome_came_too_late_for_the_plc_is_carried_to_reject(bench, monkeypatch):
    async def scenario():
        async with bench(bench=False, placing="arm") as cell:
            assert (await cell.line.order(CommandName.CHANGE_RECIPE, 2)).done
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            cell.lay("blueberry", 1)
            records = cell.station.service.registry.records
            conclude = records.conclude

            async def slow(*of):
                judged = await conclude(*of)
                assert judged.outcome == "PASS"
                late = {"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True}
                await cell.line.publish(judged.model_copy(update=late))
                return judged

            monkeypatch.setattr(records, "conclude", slow)
            let_go = []
            cell.at(State.RETREATING_READY, lambda: let_go.extend(places_of(cell)))
            assert (await cell.line.begin()).refusal is None
            await cell.until(lambda: let_go)
            return let_go

    assert asyncio.run(scenario()) == ["reject"]


@pytest.mark.timeout(240)
def test_fruit_that_is_let_go_in_the_nest_needs_no_person_where_the_arm_fails_meanwhile(bench):
    lost = ArmFault(ArmCause.LINK_LOST, arm_messages.LINK_CUT())

    async def scenario():
        async with bench(bench=False) as cell:
            assert (await cell.line.order(CommandName.CHANGE_RECIPE, 2)).done
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            cell.lay("blueberry", 1)
            service = cell.station.service
            left = asyncio.Event()

            def lose():
                cell.at(State.RETREATING_READY, left.set)
                service.device_changed(lost)

            cell.at(State.PLACING_ACCEPT, lose)
            assert (await cell.line.inspect()).outcome == "PASS"
            async with asyncio.timeout(60):
                await left.wait()
            service.device_changed(lost)
            await cell.reach(State.HELD)
            await cell.line.ready()

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_the_arm_places_fruit_and_needs_a_person_for_one_that_it_keeps_but_none_for_its_own_stop(bench):
    async def scenario():
        async with bench(bench=False, placing="arm") as cell:
            [arm] = [server for server in cell.twin._servers if isinstance(server, UrController)]
            line = cell.line

            assert (await line.order(CommandName.CHANGE_RECIPE, 2)).done
            # The arm's program is uploaded, and the gripper activated at home.
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            for bruised, pose in ((False, "accept"), (True, "reject")):
                await line.ready()
                cell.lay("blueberry", 1, bruised=bruised)
                let_go = []
                cell.at(State.RETREATING_READY, lambda let_go=let_go: let_go.extend(places_of(cell)))
                outcome = await line.inspect()
                await line.ready()
                assert (outcome.outcome == "PASS") == (pose == "accept"), outcome
                assert let_go == [pose]

            cell.lay("blueberry", 1)
            cell.at(State.PLACING_ACCEPT, lambda: cell.twin.boards["gripper"].set("off"))
            held = await line.inspect()
            assert held.outcome == "PASS"
            await cell.until(lambda: cell.phase is State.CARRIED and AlarmId.FRUIT_HELD in active(cell))
            state = await line.state()
            assert (state.ready, state.packml_state) == (False, PackmlState.HELD)
            assert state.why_not_ready == states.CARRIED()
            cell.twin.boards["gripper"].clear()
            cell.twin.world.remove()
            await asyncio.sleep(1.0)
            assert cell.phase is State.CARRIED, "only a person's reset leads on"
            done = await line.order(CommandName.RESET)
            assert done.done, done.why
            await line.ready()
            assert AlarmId.FRUIT_HELD not in active(cell)
            assert places_of(cell) == ["above_nest"]

            device_manager = cell.station.service._devices
            renew, device_manager.renew_health = device_manager.renew_health, lambda: None
            # A controller that pauses itself, as on a busy machine, forgives a silence: not this one.
            forgive, arm.script.stood_still = arm.script.stood_still, forgive_nothing
            restart, restarted = device_manager.restart_program, []

            async def restart_once_healthy():
                restarted.append((device_manager.needs_program_restart, active(cell), (await line.state()).ready))
                device_manager.renew_health, device_manager.restart_program, arm.script.stood_still = (
                    renew,
                    restart,
                    forgive,
                )
                await restart()

            # Checked as it begins: the station is quicker than a test that polls.
            device_manager.restart_program = restart_once_healthy
            await cell.until(lambda: restarted)
            [(needed, alarms, ready)] = restarted
            assert needed
            assert AlarmId.ARM_NOT_READY in alarms
            assert not ready
            await line.ready()

            faults = cell.twin.boards["arm"]
            faults.set("registers_in_use")  # which only new clients are sent
            faults.set("link_cut")
            await cell.until(lambda: "arm" in device_manager.faults)
            faults.clear("link_cut")
            await cell.until(lambda: AlarmId.ARM_NOT_REMOTE in active(cell))
            fault = ArmFault(ArmCause.REGISTERS_IN_USE, arm_messages.REGISTERS_IN_USE())
            assert cell.station.service.alarms.alarms.get(AlarmId.ARM_NOT_REMOTE).detail == fault.message
            depths = []
            for _ in range(5):  # as often as it is checked while it waits for a person, all night perhaps
                with pytest.raises(ArmFault) as caught:
                    await device_manager._check_arm()
                depths.append(len(list(traceback.walk_tb(caught.value.__traceback__))))
            assert depths == 5 * depths[:1]
            faults.clear()
            done = await line.client.request(Recover(what="program"), CommandDone, deadline_s=60)
            assert done.done, done.why
            await line.ready()

    asyncio.run(scenario())


def test_without_automatic_reset_a_station_waits_for_an_order_after_every_fault(bench):
    async def scenario():
        async with bench(automatic_reset=False) as cell:
            line = cell.line
            await cell.choose("blueberry")
            await line.inspect()
            await line.ready()
            cell.twin.boards["gripper"].set("off")
            await cell.reach(State.HELD)
            cell.twin.boards["gripper"].clear()
            await cell.reach(State.STOPPED)
            await asyncio.sleep(1.0)
            state = await line.state()
            assert (state.ready, state.packml_state) == (False, PackmlState.STOPPED)
            assert state.why_not_ready == states.STOPPED()
            done = await line.order(CommandName.RESET)
            assert done.done, done.why
            assert (await line.ready()).packml_state is PackmlState.IDLE

    asyncio.run(scenario())


def test_an_outcome_that_the_disk_refuses_is_not_told_and_becomes_no_result_once_it_takes_again(bench):
    async def scenario():
        async with bench() as cell:
            line = cell.line
            await cell.choose("blueberry")
            await line.ready()
            before = resource.getrlimit(resource.RLIMIT_FSIZE)
            cell.at(State.JUDGING, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1])))
            try:
                reply = await line.begin()
                awaited = asyncio.create_task(line.outcome(reply.sequence))
                await cell.until(lambda: cell.phase is State.HELD and AlarmId.RECORDS_NOT_WRITABLE in active(cell))
                state = await line.state()
                assert not state.ready
                assert "records" in str(state.why_not_ready)
                assert not awaited.done(), "what is not durable is not published"
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
            outcome = await awaited
            assert (outcome.sequence, outcome.outcome) == (reply.sequence, "NO_RESULT")
            assert set(outcome.reasons) <= {Reason.RECORDS_FAULT, Reason.STATION_LOST}
            await line.publish(outcome)
            await line.ready()
            await cell.until(lambda: AlarmId.RECORDS_NOT_WRITABLE not in active(cell))
            assert cell.twin.world.opening_mm() == pytest.approx(85, abs=1)
            again = await line.inspect()
            assert again.sequence == reply.sequence + 1
            assert again.area_mm2 is not None

    asyncio.run(scenario())


def test_answers_that_are_lost_as_the_fruit_is_let_go_are_asked_for_again(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            gripper = cell.station.service._devices.cell.gripper
            status, lost = gripper.link.status, []

            async def lose_some():
                if len(lost) < 4:
                    lost.append(await status())
                    raise GripperSilentError(verbatim("the answer was lost"), verbatim("look at the network"))
                return await status()

            cell.at(State.PLACING_ACCEPT, lambda: setattr(gripper.link, "status", lose_some))
            assert (await cell.line.inspect()).outcome == "PASS"
            await cell.line.ready()
            assert lost
            assert AlarmId.FRUIT_HELD not in active(cell)
            await cell.reach(State.IDLE)
            assert cell.twin.world.opening_mm() == pytest.approx(85, abs=1)

    asyncio.run(scenario())
