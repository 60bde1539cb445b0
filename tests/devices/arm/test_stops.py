"""Stops of the arm and what ends them, over the wire, with the real ur-rtde."""

import asyncio
import logging
import os
import signal

import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.twin.ur.safety import SafetyMode
from station.twin.ur.script import ControlScript, RuntimeState
from tests.devices.arm.states import A_TENTH, AWAY, cause_of, has_cause, moving


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
            assert (await arm.state()).fault is None

    asyncio.run(run())


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
            assert (await arm.state()).fault is None

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
            # The script connection was dropped: ur-rtde's reuploadScript returns True, and nothing plays.
            await arm.upload_again()
            assert caplog.messages == ["arm link: ready"], "the first attempt's failure is no other fault"
            await arm.move_to("accept")

    asyncio.run(run())


def test_local_control_that_ends_before_the_controllers_next_cycle_leaves_it_remote(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, _):
            bench.faults.set("local_mode")
            bench.faults.clear("local_mode")
            bench.faults.set("safeguard")
            await until(lambda: bench.controller.safety.guard_open)
            assert bench.controller.safety.remote

    asyncio.run(run())


def test_a_controller_that_starts_finds_the_pendants_key_and_button_as_they_are(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, _):
            for fault in ("local_mode", "emergency_stop", "off"):
                bench.faults.set(fault)
            before = bench.controller.safety
            await until(lambda: before.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP)
            bench.faults.clear("off")
            await until(lambda: bench.controller.safety is not before)
            safety = bench.controller.safety
            assert (safety.remote, safety.safety_mode) == (False, SafetyMode.ROBOT_EMERGENCY_STOP)

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
                assert (await arm.state()).fault is None

    asyncio.run(run())


def test_registers_that_another_client_claimed_are_named_also_after_a_while_of_watching(
    healthy_arm, until, monkeypatch
):
    async def run():
        async with healthy_arm() as (bench, _), UrArm(bench.settings()) as second:
            assert await cause_of(second.ready(20.0)) is ArmCause.REGISTERS_IN_USE
            watch, watched = second._link._watch, []

            async def noted(process):
                await watch(process)
                watched.append(process)

            monkeypatch.setattr(second._link, "_watch", noted)
            await until(lambda: watched)
            assert await cause_of(second.upload_again()) is ArmCause.REGISTERS_IN_USE

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
            assert (await arm.state()).fault is None

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
