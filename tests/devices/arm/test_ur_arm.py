"""The driver against the emulated controller, over the wire, with the real ur-rtde."""

import asyncio
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import pytest

from station.devices.arm.arm import ArmState
from station.devices.arm.faults import REMEDIES, ArmCause, ArmFault
from station.devices.arm.messages import Beat, Move, Outcome, Reachable, Snapshot, Start, Watch
from station.devices.arm.process_handle import ArmProcess
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.settings.arm import ArmPoses, ArmSettings
from station.twin.ur.script import ControlScript, RuntimeState

AWAY = ArmPoses(home=(2.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0))
"""A home that is a long way off."""
A_TENTH = 9.0
"""Of its speed, by the fault `slow`: an arm that is to be stopped on its way does not arrive before, however busy the
machine."""


async def moving(bench) -> bool:
    return max(map(abs, bench.controller.body.speeds_rad_s)) > 0.1


async def cause_of(awaitable) -> ArmCause:
    with pytest.raises(ArmFault) as caught:
        await awaitable
    assert caught.value.message == messages.FAULT(cause=caught.value.detail, remedy=REMEDIES[caught.value.cause])
    return caught.value.cause


async def is_young(arm: UrArm) -> bool:
    """Whether the state came just now, which on a busy machine not each one does."""
    age_s = (await arm.state()).age_s
    return age_s is not None and 0.0 <= age_s < 0.1


def test_it_goes_from_pose_to_pose_and_says_where_it_is(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            for pose in ("above_nest", "nest", "above_nest", "accept", "accept"):
                await arm.move_to(pose)
                state = await arm.state()
                assert state.ready
                assert state.at == pose
                assert state.moving is False
                await until(lambda: is_young(arm))
                assert bench.controller.joints_rad == pytest.approx(bench_pose(arm, pose), abs=1e-6)

    asyncio.run(run())


def test_an_arm_that_is_there_already_is_not_sent_there_again(healthy_arm, monkeypatch):
    async def run():
        async with healthy_arm() as (bench, arm):
            orders, order = [], arm._link.order

            async def noted(request):
                orders.append(type(request))
                return await order(request)

            monkeypatch.setattr(arm._link, "order", noted)
            await arm.move_to("above_nest")
            await arm.move_to("above_nest")
            assert orders.count(Move) == 1
            await arm.move_to("nest")
            await arm.move_beside_nest((0.3, 0.0, 0.0))
            await arm.move_to("nest")
            assert bench.controller.joints_rad == pytest.approx(bench_pose(arm, "nest"), abs=1e-6), "beside is not at"

            snapshot = arm._link.snapshot

            async def stopped():
                return (await snapshot()).model_copy(update={"runtime_state": RuntimeState.STOPPED})

            orders.clear()
            monkeypatch.setattr(arm._link, "snapshot", stopped)
            await arm.move_to("nest")
            assert orders == [Move], "where the program does not play, the controller's answer says so"

    asyncio.run(run())


def bench_pose(arm: UrArm, pose):
    return arm._settings.poses.joints_rad(pose)


def test_it_keeps_to_the_speeds_and_goes_straight_to_the_nest(healthy_arm):
    async def run():
        async with healthy_arm(joint_speed_rad_s=0.8, tool_speed_mm_s=80.0) as (bench, arm):
            joint_peak, tool_peak, off_line_m = 0.0, 0.0, 0.0

            async def watch():
                nonlocal joint_peak, tool_peak, off_line_m
                while True:
                    joint_peak = max(joint_peak, *map(abs, bench.controller.body.speeds_rad_s))
                    x, y, z = bench.controller.body.tool_speed()[:3]
                    tool_peak = max(tool_peak, (x * x + y * y + z * z) ** 0.5)
                    x, y = bench.controller.body.tool_pose()[:2]
                    off_line_m = max(off_line_m, ((x + 0.75) ** 2 + (y + 0.15) ** 2) ** 0.5)
                    await asyncio.sleep(0.002)

            watching = asyncio.create_task(watch())
            await arm.move_to("accept")
            assert joint_peak == pytest.approx(0.8, rel=1e-3)
            await arm.move_to("above_nest")
            tool_peak = off_line_m = 0.0
            await arm.move_to("nest")
            assert tool_peak == pytest.approx(0.08, rel=0.01)
            assert off_line_m < 0.0005
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)

    asyncio.run(run())


def test_a_stop_in_mid_move_brakes_and_ends_the_move(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", A_TENTH)
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            assert await cause_of(arm.move_to("accept")) is ArmCause.BUSY
            await arm.stop()
            assert await cause_of(move) is ArmCause.STOPPED
            assert not bench.controller.body.moving
            state = await arm.state()
            assert state.ready
            assert state.at is None
            await arm.stop()
            bench.faults.clear("slow")
            await arm.move_to("home")
            assert (await arm.state()).at == "home"

    asyncio.run(run())


@pytest.mark.parametrize("turns", [0, 1, 3, 10, 30])
def test_a_stop_at_the_very_beginning_of_a_move_stops_it_too(healthy_arm, until, turns):
    async def run():
        async with healthy_arm(poses=AWAY, joint_speed_rad_s=0.5) as (bench, arm):
            bench.faults.set("slow", A_TENTH)
            move = asyncio.create_task(arm.move_to("home"))
            for _ in range(turns):
                await asyncio.sleep(0)
            await asyncio.gather(arm.stop(), return_exceptions=True)
            assert await cause_of(move) is ArmCause.STOPPED
            await until(lambda: not bench.controller.body.moving)
            assert bench.controller.joints_rad[0] < 0.2

    asyncio.run(run())


def test_a_cancelled_move_is_stopped(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", A_TENTH)
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            move.cancel()
            await asyncio.gather(move, return_exceptions=True)
            await until(lambda: not bench.controller.body.moving)
            assert bench.controller.joints_rad[0] < 1.9

    asyncio.run(run())


def test_a_move_that_does_not_arrive_in_time_is_stopped(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY, joint_speed_rad_s=0.2, move_deadline_s=0.8) as (bench, arm):
            assert await cause_of(arm.move_to("home")) is ArmCause.DEADLINE
            await until(lambda: not bench.controller.body.moving)
            assert bench.controller.joints_rad[0] < 1.0

    asyncio.run(run())


def test_a_protective_stop_in_mid_move_waits_for_a_person_and_for_its_five_seconds(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            bench.faults.set("protective_stop")
            assert await cause_of(move) is ArmCause.PROTECTIVE_STOP
            await arm.stop()
            assert not bench.controller.body.moving
            assert (await arm.state()).moving is False
            assert await cause_of(arm.move_to("home")) is ArmCause.PROTECTIVE_STOP
            assert await cause_of(arm.upload_again()) is ArmCause.PROTECTIVE_STOP
            stopped_at_s = bench.clock.now_s()
            confirming = asyncio.create_task(arm.confirm_protective_stop())
            await asyncio.sleep(1.0)
            assert bench.controller.safety.bits & 1 << 2
            await confirming
            assert bench.clock.now_s() - stopped_at_s > 4.0
            await arm.move_to("home")
            assert (await arm.state()).at == "home"

    asyncio.run(run())


def test_an_arm_behind_a_guard_that_was_opened_does_not_go_on_when_it_closes(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", A_TENTH)
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            bench.faults.set("safeguard")
            assert await cause_of(move) is ArmCause.SAFEGUARD_STOP
            await arm.stop()
            assert bench.controller.script.ended_because == "the dashboard stopped the program"
            bench.faults.clear()
            await until(lambda: bench.controller.safety.may_move)
            assert await cause_of(arm.move_to("home")) is ArmCause.SAFEGUARD_STOP
            assert not bench.controller.body.moving
            assert (await arm.state()).at is None
            await arm.upload_again()
            await arm.move_to("home")
            assert (await arm.state()).at == "home"

    asyncio.run(run())


def test_a_stop_brakes_an_arm_that_moves_whatever_fault_waits_for_a_person(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", A_TENTH)
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            arm._link._set(ArmFault(ArmCause.PROGRAM_STOPPED, messages.PROGRAM_STOPPED()))
            assert await cause_of(move) is ArmCause.PROGRAM_STOPPED
            await arm.stop()
            assert not bench.controller.body.moving

    asyncio.run(run())


def test_an_emergency_stop_needs_the_button_then_power_then_brakes(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            bench.faults.set("emergency_stop")
            assert await cause_of(move) is ArmCause.EMERGENCY_STOP
            assert await cause_of(arm.power_on_and_release_brakes()) is ArmCause.EMERGENCY_STOP
            bench.faults.clear("emergency_stop")

            async def unpowered():
                return (await arm.state()).fault.cause is ArmCause.NOT_POWERED

            await until(unpowered)
            assert await cause_of(arm.move_to("home")) is ArmCause.NOT_POWERED
            await arm.power_on_and_release_brakes()
            await arm.move_to("home")
            assert (await arm.state()).at == "home"

    asyncio.run(run())


def test_a_safety_fault_is_mended_by_a_restart_of_the_safety_system(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("safety_fault")
            await until(lambda: has_cause(arm, ArmCause.SAFETY_FAULT))
            await arm.power_on_and_release_brakes()
            assert (await arm.state()).ready

    asyncio.run(run())


async def has_cause(arm: UrArm, cause: ArmCause) -> bool:
    fault = (await arm.state()).fault
    return fault is not None and fault.cause is cause


def test_a_program_stopped_on_the_pendant_stays_stopped_until_a_person_uploads_it(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            bench.faults.set("pendant_stop")
            assert await cause_of(move) is ArmCause.PROGRAM_STOPPED
            bench.faults.clear("pendant_stop")
            await asyncio.sleep(0.5)
            assert bench.controller.script.runtime_state is RuntimeState.STOPPED
            assert await cause_of(arm.move_to("home")) is ArmCause.PROGRAM_STOPPED
            await arm.upload_again()
            await arm.upload_again()
            await arm.move_to("home")

    asyncio.run(run())


def test_what_waits_for_a_person_outlives_the_process(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("pendant_stop")
            await until(lambda: has_cause(arm, ArmCause.PROGRAM_STOPPED))
            first = arm.process_id
            os.kill(first, signal.SIGKILL)

            async def back():
                return arm.process_id not in {first, None} and (await arm.state()).joints_rad is not None

            await until(back)
            await asyncio.sleep(0.5)
            assert await has_cause(arm, ArmCause.PROGRAM_STOPPED)
            assert bench.controller.script.runtime_state is RuntimeState.STOPPED
            await arm.upload_again()
            assert (await arm.state()).ready

    asyncio.run(run())


def test_a_slow_arm_goes_on_at_a_fraction_of_its_speed(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", 4.0)
            move = asyncio.create_task(arm.move_to("home"))

            async def at_a_fifth() -> bool:
                if move.done():
                    await move  # which says why
                return max(map(abs, bench.controller.body.speeds_rad_s)) == pytest.approx(0.4, rel=1e-3)

            await until(at_a_fifth)
            bench.faults.clear("slow")
            await move

    asyncio.run(run())


def test_local_control_is_named_and_the_program_comes_back_after_it(healthy_arm, until, caplog):
    caplog.set_level(logging.INFO, "station.devices.arm.link")

    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("local_mode")
            await until(lambda: has_cause(arm, ArmCause.LOCAL_CONTROL))
            assert await cause_of(arm.move_to("accept")) is ArmCause.LOCAL_CONTROL
            assert await cause_of(arm.upload_again()) is ArmCause.LOCAL_CONTROL
            assert await cause_of(arm.confirm_protective_stop()) is ArmCause.LOCAL_CONTROL
            bench.faults.clear("local_mode")
            await until(lambda: bench.controller.safety.remote)
            caplog.clear()
            # The script connection was dropped: ur-rtde's reuploadScript says True, and nothing plays.
            await arm.upload_again()
            assert caplog.messages == ["arm link: ready"], "the first attempt's failure is no other fault"
            await arm.move_to("accept")

    asyncio.run(run())


def test_a_persons_verb_is_refused_at_once_where_local_control_forbids_it(healthy_arm, until):
    async def run():
        async with healthy_arm(recovery_deadline_s=30.0) as (bench, arm):
            bench.faults.set("protective_stop")
            await until(lambda: has_cause(arm, ArmCause.PROTECTIVE_STOP))
            bench.faults.set("local_mode")
            await until(lambda: not bench.controller.safety.remote)
            assert await cause_of(arm.confirm_protective_stop()) is ArmCause.LOCAL_CONTROL
            assert await cause_of(arm.power_on_and_release_brakes()) is ArmCause.LOCAL_CONTROL

    asyncio.run(run())


@pytest.mark.parametrize(
    ("fault", "cause"), [("local_mode", ArmCause.LOCAL_CONTROL), ("registers_in_use", ArmCause.REGISTERS_IN_USE)]
)
def test_what_forbids_the_connection_is_named(bench, fault, cause):
    async def run():
        async with bench() as made:
            made.faults.set(fault)
            await asyncio.sleep(0.05)
            async with UrArm(made.settings()) as arm:
                assert await cause_of(arm.ready(20.0)) is cause
                assert (await arm.state()).joints_rad is not None
                made.faults.clear(fault)
                await asyncio.sleep(0.05)
                await arm.upload_again()
                assert (await arm.state()).ready

    asyncio.run(run())


def test_registers_that_another_client_claimed_are_named(healthy_arm):
    async def run():
        async with healthy_arm() as (bench, _), UrArm(bench.settings()) as second:
            assert await cause_of(second.ready(20.0)) is ArmCause.REGISTERS_IN_USE

    asyncio.run(run())


def test_a_pose_out_of_range_is_not_driven_to(bench, healthy):
    async def run():
        async with bench(joint_range_rad=3.2) as made:
            poses = ArmPoses(accept=(0.0, -1.57, 3.3, -1.57, -1.57, 0.0))
            async with UrArm(made.settings(poses=poses)) as arm, healthy(arm):
                await arm.ready(20.0)
                before = made.controller.joints_rad
                assert await cause_of(arm.move_to("accept")) is ArmCause.UNREACHABLE
                assert made.controller.joints_rad == before
                await arm.move_to("reject")

    asyncio.run(run())


def test_a_cut_link_in_mid_move_stops_the_arm_and_comes_back_by_itself(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY, joint_speed_rad_s=0.5) as (bench, arm):
            bench.forgive_no_silence()
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            bench.faults.set("link_cut")
            assert await cause_of(move) is ArmCause.LINK_LOST
            state = await arm.state()
            assert state.joints_rad is None
            assert not state.ready
            assert await cause_of(arm.stop()) is ArmCause.LINK_LOST
            await until(lambda: not bench.controller.body.moving)
            assert bench.controller.joints_rad[0] < 1.9
            bench.faults.clear("link_cut")
            await arm.ready(15.0)
            await arm.move_to("above_nest")

    asyncio.run(run())


def test_a_controller_that_was_switched_off_comes_back_without_power(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("off")
            await until(lambda: has_cause(arm, ArmCause.LINK_LOST))
            bench.faults.clear("off")
            await until(lambda: has_cause(arm, ArmCause.NOT_POWERED))
            await arm.power_on_and_release_brakes()
            await arm.move_to("accept")

    asyncio.run(run())


def test_a_silent_controller_is_given_up_within_the_limit(bench, healthy):
    async def run():
        async with bench() as made, UrArm(made.settings(constructor_limit_s=5.0)) as arm, healthy(arm):
            made.faults.set("silent")
            begun = time.monotonic()
            assert await cause_of(arm.ready(3.0)) is ArmCause.LINK_LOST
            assert time.monotonic() - begun < 20.0
            made.faults.clear("silent")
            await arm.ready(30.0)

    asyncio.run(run())


def test_a_controller_that_falls_silent_in_the_constructor_is_killed(bench, healthy, until):
    """The dashboard answers and RTDE does not: ur-rtde's constructor hangs for ever, holding the interpreter's lock."""

    async def run():
        async with bench() as made:
            made.faults.set("rtde_silent")
            async with UrArm(made.settings()) as arm, healthy(arm):
                await until(lambda: arm.process_id is not None)
                hung = psutil.Process(arm.process_id)
                ticks = 0

                async def tick():
                    nonlocal ticks
                    while True:
                        ticks += 1
                        await asyncio.sleep(0.02)

                ticking = asyncio.create_task(tick())
                await until(lambda: not hung.is_running(), 60.0)
                assert ticks > 10
                ticking.cancel()
                await asyncio.gather(ticking, return_exceptions=True)
                made.faults.clear("rtde_silent")
                await arm.ready(60.0)

    asyncio.run(run())


def test_a_link_that_comes_and_goes_is_put_back(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            first = arm.process_id
            bench.faults.set("intermittent", 3.0)
            await until(lambda: arm.process_id not in {first, None})
            bench.faults.clear("intermittent")
            await arm.ready(15.0)
            await arm.move_to("accept")

    asyncio.run(run())


ALWAYS = 1000


@pytest.mark.parametrize("ended", [1, 2, ALWAYS])
def test_a_program_that_ends_as_it_begins_is_started_again_and_then_left_to_a_person(bench, healthy, until, ended):
    """As a link does that is cut while ur-rtde starts the program, which nobody has stopped then."""

    async def run():
        async with bench() as made:
            script, left = made.controller.script, ended
            begin = script._begin

            def end_or_begin(command):
                nonlocal left
                if not left:
                    begin(command)
                    return
                left -= 1
                script.end("the link was cut")

            script._begin = end_or_begin
            async with UrArm(made.settings()) as arm, healthy(arm):
                if ended != ALWAYS:
                    await until(lambda: not left and script.runtime_state is RuntimeState.PLAYING, 60.0)
                    await arm.ready(60.0)
                    await arm.move_to("accept")
                else:
                    await until(lambda: has_cause(arm, ArmCause.PROGRAM_STOPPED), 60.0)
                    assert ended - left == 3
                    left = 0
                    await asyncio.sleep(0.5)
                    assert script.runtime_state is RuntimeState.STOPPED
                    await arm.upload_again()
                    await arm.move_to("accept")

    asyncio.run(run())


def test_a_connection_that_the_controller_closes_is_told_by_the_process_with_its_next_state(bench, until):
    async def run():
        async with bench() as made:
            process = await ArmProcess.spawn(made.host, 125.0)
            try:
                for request in (Start(), Watch()):
                    assert (await process.request(request, Outcome, deadline_s=60.0)).done

                async def connected():
                    return (await process.request(Beat(healthy_for_s=0.0), Snapshot, deadline_s=60.0)).connected

                assert await connected()
                made.faults.set("link_cut")

                async def cut():
                    return not await connected()

                await until(cut)
            finally:
                await process.end()

    asyncio.run(run())


def test_a_station_that_starts_in_an_emergency_stop_starts_no_program_once_it_is_released(bench, healthy, until):
    async def run():
        async with bench() as made:
            made.faults.set("emergency_stop")
            async with UrArm(made.settings()) as arm, healthy(arm):
                await until(lambda: has_cause(arm, ArmCause.EMERGENCY_STOP), 60.0)
                process = arm.process_id
                made.faults.clear("emergency_stop")
                await until(lambda: has_cause(arm, ArmCause.NOT_POWERED), 60.0)
                for command in ("power on", "brake release"):
                    made.controller.answer(command)
                await until(lambda: has_cause(arm, ArmCause.PROGRAM_STOPPED), 60.0)
                await asyncio.sleep(0.5)
                assert made.controller.script.runtime_state is RuntimeState.STOPPED
                assert arm.process_id == process, "the link is well: nothing is connected anew"

    asyncio.run(run())


def test_a_stream_frozen_too_long_counts_as_a_lost_link(healthy_arm, until):
    """ur-rtde says that it is connected all the while."""

    async def run():
        async with healthy_arm() as (bench, arm):
            first = arm.process_id
            bench.faults.set("stuck")
            await until(lambda: arm.process_id not in {first, None})
            bench.faults.clear("stuck")
            await arm.ready(15.0)

    asyncio.run(run())


@pytest.mark.parametrize("fault", ["stuck", "garbage"])
def test_an_order_ends_when_the_state_has_grown_too_old(healthy_arm, fault):
    """The call's own deadline is far off: only the state's age can end it before the test's limit."""

    async def run():
        async with healthy_arm(call_deadline_s=10.0) as (bench, arm):
            bench.faults.set(fault)
            async with asyncio.timeout(6.0):
                with pytest.raises(ArmFault) as caught:
                    await arm._link.order(Reachable(joints_rad=arm._settings.poses.accept))
            assert caught.value.cause is ArmCause.LINK_LOST
            bench.faults.clear(fault)
            await arm.ready(15.0)

    asyncio.run(run())


def test_an_order_does_not_wait_for_ever_for_its_turn(healthy_arm):
    async def run():
        async with healthy_arm(call_deadline_s=0.5) as (_, arm), arm._link._lock:
            async with asyncio.timeout(5.0):
                with pytest.raises(ArmFault) as caught:
                    await arm._link.order(Reachable(joints_rad=arm._settings.poses.accept))
            assert caught.value.cause is ArmCause.BUSY
            assert caught.value.detail == messages.LINK_BUSY(limit_s=0.5, request=messages.REQUEST_REACHABLE())

    asyncio.run(run())


@pytest.mark.parametrize("fault", ["stuck", "delayed"])
def test_a_stream_that_freezes_or_comes_late_is_stale(healthy_arm, until, fault):
    async def run():
        async with healthy_arm(stale_after_s=0.3, link_lost_after_s=4.0) as (bench, arm):
            bench.faults.set(fault, 0.4)
            # One answer that comes late on a busy machine is stale as well; 0.4 s after the fault every state is.
            old_from_s = time.monotonic() + 0.4
            states: list[ArmState] = []

            async def is_old() -> bool:
                asked_s = time.monotonic()
                states.append(await arm.state())
                return asked_s > old_from_s and states[-1].age_s is not None

            await until(is_old)
            state = states[-1]
            assert state.fault is not None
            assert state.fault.cause is ArmCause.STALE
            assert state.joints_rad is None
            assert state.at is None
            assert (state.age_s or 0.0) > 0.3
            assert await cause_of(arm.move_to("accept")) is ArmCause.STALE
            bench.faults.clear(fault)

            async def ready():
                return (await arm.state()).joints_rad is not None

            await until(ready)

    asyncio.run(run())


def test_garbage_on_the_wire_hurts_nobody_but_the_process(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("garbage")
            await until(lambda: has_cause(arm, ArmCause.LINK_LOST))
            bench.faults.clear("garbage")
            await arm.ready(15.0)
            await arm.move_to("accept")

    asyncio.run(run())


def test_wrong_joint_angles_do_not_pass_for_arrival(healthy_arm):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("wrong", 0.05)
            assert await cause_of(arm.move_to("accept")) is ArmCause.NOT_REACHED

    asyncio.run(run())


@pytest.mark.parametrize("kind", [signal.SIGKILL, signal.SIGSEGV])
def test_a_process_that_dies_in_mid_move_is_put_back(healthy_arm, until, kind):
    async def run():
        async with healthy_arm(poses=AWAY, joint_speed_rad_s=0.5) as (bench, arm):
            move = asyncio.create_task(arm.move_to("home"))
            await until(lambda: moving(bench))
            first = arm.process_id
            os.kill(first, kind)
            assert await cause_of(move) is ArmCause.LINK_LOST
            await arm.ready(15.0)
            assert arm.process_id != first
            await until(lambda: not bench.controller.body.moving)
            await arm.move_to("above_nest")

    asyncio.run(run())


def test_a_process_that_hangs_is_killed(healthy_arm, until):
    async def run():
        async with healthy_arm() as (_, arm):
            hung = arm.process_id
            os.kill(hung, signal.SIGSTOP)
            await until(lambda: arm.process_id not in {hung, None})
            assert not psutil.pid_exists(hung)
            await arm.ready(15.0)

    asyncio.run(run())


def test_a_process_that_ends_again_and_again_is_replaced_each_time_and_waits_for_nobody(healthy_arm, until):
    """A dropped link ends it: a cable with a loose contact needs a person for the cable, not for the program."""

    async def run():
        async with healthy_arm() as (_, arm):
            for _ in range(8):
                os.kill(arm.process_id, signal.SIGKILL)
                await until(lambda: has_cause(arm, ArmCause.LINK_LOST))
                await arm.ready(15.0)
            await arm.move_to("accept")

    asyncio.run(run())


def test_a_station_that_is_not_healthy_any_more_has_its_arm_stopped_by_the_controller(bench, until):
    async def run():
        async with bench() as made, UrArm(made.settings(poses=AWAY, joint_speed_rad_s=0.2)) as arm:
            await arm.ready(20.0)
            made.forgive_no_silence()
            arm.renew_health(0.5)
            move = asyncio.create_task(arm.move_to("home"))
            assert await cause_of(move) is ArmCause.WATCHDOG
            assert made.controller.script.ended_because == "the RTDE watchdog expired"
            await until(lambda: not made.controller.body.moving)
            assert await cause_of(arm.move_to("home")) is ArmCause.WATCHDOG
            arm.renew_health(60.0)
            await arm.upload_again()
            assert (await arm.state()).ready

    asyncio.run(run())


def test_a_stop_on_the_pendant_after_a_short_lapse_of_the_stations_health_waits_for_a_person(bench, until, monkeypatch):
    # The lapse ends before the watchdog expires, however busy the machine.
    monkeypatch.setattr(ControlScript, "_set_watchdog", lambda _script: None)

    async def run():
        async with bench() as made, UrArm(made.settings()) as arm:
            arm.renew_health(60.0)
            await arm.ready(20.0)
            arm.renew_health(0.0)
            await until(lambda: not arm._link._was_healthy)
            arm.renew_health(60.0)
            await until(lambda: arm._link._was_healthy)
            made.faults.set("pendant_stop")
            await until(lambda: has_cause(arm, ArmCause.PROGRAM_STOPPED))

    asyncio.run(run())


@pytest.fixture
def short_folder():
    """A folder for sockets, whose paths have 107 bytes at most."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def test_the_process_goes_when_its_caller_is_killed(bench, until, short_folder, monkeypatch):
    """Killed, not closed: nothing of the caller's own can clean up, so the next start does."""
    caller = """
import asyncio, sys
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.settings.arm import ArmSettings

async def main():
    arm = UrArm(ArmSettings(host=sys.argv[1]))
    await arm.open()
    await arm.ready(20.0)
    print(arm.process_id, flush=True)
    await asyncio.sleep(60)

asyncio.run(main())
"""

    async def run():
        async with bench() as made:
            process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-c",
                caller,
                made.host,
                stdout=subprocess.PIPE,
                env=os.environ | {"TMPDIR": str(short_folder)},
            )
            assert process.stdout is not None
            line = await asyncio.wait_for(process.stdout.readline(), 30)
            child = psutil.Process(int(line))
            process.kill()
            await process.wait()
            await until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
            (left,) = short_folder.glob("fruit-station-arm-*")
            living = short_folder / f"fruit-station-arm-{os.getppid()}-living"
            living.mkdir()
            monkeypatch.setattr(tempfile, "tempdir", str(short_folder))
            async with UrArm(made.settings()) as arm:
                await arm.ready(20.0)
                assert not left.exists()
                assert len(list(short_folder.glob(f"fruit-station-arm-{os.getpid()}-*"))) == 1
            assert list(short_folder.iterdir()) == [living]

    asyncio.run(run())


def test_an_arm_that_nobody_answers_for_is_a_fault_and_not_an_exception(host):
    async def run():
        async with UrArm(ArmSettings(host=host)) as arm:
            assert await cause_of(arm.ready(1.0)) is ArmCause.LINK_LOST
            state = await arm.state()
            assert state.age_s is None
            assert not state.ready
            assert await cause_of(arm.move_to("home")) is ArmCause.LINK_LOST
        assert await cause_of(arm.move_to("home")) is ArmCause.CLOSED

    asyncio.run(run())
