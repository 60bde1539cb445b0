"""Motions of the arm, over the wire, with the real ur-rtde: where it goes, how fast, and what ends one."""

import asyncio

import pytest

from station.devices.arm.faults import ArmCause
from station.devices.arm.messages import Move, Reachable
from station.devices.arm.ur import UrArm
from station.settings.arm import ArmPoses
from station.twin.ur.script import RuntimeState
from tests.devices.arm.states import A_TENTH, AWAY, cause_of, is_young, moving


def test_it_goes_from_pose_to_pose_and_says_where_it_is(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            for pose in ("above_nest", "nest", "above_nest", "accept", "accept"):
                await arm.move_to(pose)
                state = await arm.state()
                assert state.fault is None
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
            assert orders == [Move], "where the program does not play, the controller's answer shows it"

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
            assert state.fault is None
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


def test_no_motion_begins_after_a_stop_that_came_while_the_pose_was_checked(healthy_arm, until, monkeypatch):
    async def run():
        async with healthy_arm() as (_, arm):
            orders, order, go_on = [], arm._link.order, asyncio.Event()

            async def held(request):
                orders.append(type(request))
                if isinstance(request, Reachable):
                    await go_on.wait()
                return await order(request)

            monkeypatch.setattr(arm._link, "order", held)
            move = asyncio.create_task(arm.move_to("accept"))
            await until(lambda: Reachable in orders)
            await arm.stop()
            go_on.set()
            assert await cause_of(move) is ArmCause.STOPPED
            assert Move not in orders

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


def test_a_slow_arm_goes_on_at_a_fraction_of_its_speed(healthy_arm, until):
    async def run():
        async with healthy_arm(poses=AWAY) as (bench, arm):
            bench.faults.set("slow", 4.0)
            move = asyncio.create_task(arm.move_to("home"))

            async def at_a_fifth() -> bool:
                if move.done():
                    await move  # which raises the reason
                return max(map(abs, bench.controller.body.speeds_rad_s)) == pytest.approx(0.4, rel=1e-3)

            await until(at_a_fifth)
            bench.faults.clear("slow")
            await move

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


def test_wrong_joint_angles_do_not_pass_for_arrival(healthy_arm):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("wrong", 0.05)
            assert await cause_of(arm.move_to("accept")) is ArmCause.NOT_REACHED

    asyncio.run(run())
