"""The link to the controller, cut, silent, frozen or stale, over the wire, with the real ur-rtde."""

import asyncio
import time

import pytest

from station.devices.arm import dashboard, link
from station.devices.arm.arm import ArmState
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import Beat, Outcome, Reachable, Snapshot, Start, Watch
from station.devices.arm.process_handle import ArmProcess
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.settings.arm import ArmSettings
from station.twin.ur.script import RuntimeState
from tests.devices.arm.states import AWAY, cause_of, has_cause, moving


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
            assert state.fault is not None
            assert await cause_of(arm.stop()) is ArmCause.LINK_LOST
            await until(lambda: not bench.controller.body.moving)
            assert bench.controller.joints_rad[0] < 1.9
            bench.faults.clear("link_cut")
            await arm.ready(15.0)
            await arm.move_to("above_nest")

    asyncio.run(run())


def test_registers_that_the_controller_still_holds_for_the_cut_connection_are_waited_for(
    healthy_arm, until, monkeypatch
):
    """As it does where the cut lets no end of the connection through, until it drops it itself."""
    monkeypatch.setattr(link, "OWN_CLAIM_S", 120.0)  # longer than a busy machine takes to connect again

    async def run():
        async with healthy_arm() as (bench, arm):
            registers, held = bench.controller.registers, []
            monkeypatch.setattr(registers, "release", held.append)
            bench.faults.set("link_cut")
            await until(lambda: has_cause(arm, ArmCause.LINK_LOST))
            bench.faults.clear("link_cut")
            await until(lambda: arm._link.fault.detail == messages.OWN_REGISTERS_HELD(), 60.0)
            assert await has_cause(arm, ArmCause.LINK_LOST)
            monkeypatch.undo()
            for connection in held:
                registers.release(connection)
            await arm.ready(60.0)
            await arm.move_to("accept")

    asyncio.run(run())


def test_registers_that_stay_held_after_a_cut_are_another_clients(healthy_arm, until, monkeypatch):
    monkeypatch.setattr(link, "OWN_CLAIM_S", 3.0)
    monkeypatch.setattr(link, "LONGEST_PAUSE_S", 0.2)  # so that a window that each attempt renewed would never end

    async def run():
        async with healthy_arm() as (bench, arm):
            monkeypatch.setattr(bench.controller.registers, "release", lambda _: None)
            bench.controller.network.cut()
            await until(lambda: has_cause(arm, ArmCause.REGISTERS_IN_USE), 60.0)

    asyncio.run(run())


def test_a_request_to_the_dashboard_server_that_was_given_up_is_not_sent_on(host, monkeypatch):
    """A reset in place of an end: with it the kernel discards what it would send where a cut network comes back."""

    async def run():
        ends: asyncio.Future[BaseException | bytes] = asyncio.get_running_loop().create_future()

        async def mute(reader, writer):
            writer.write(b"Connected: Universal Robots Dashboard Server\n")
            assert await reader.readline() == b"brake release\n"
            ends.set_result((await asyncio.gather(reader.read(), return_exceptions=True))[0])
            writer.close()

        async with await asyncio.start_server(mute, host, dashboard.PORT):
            async with dashboard.dashboard(host) as conversation:
                monkeypatch.setattr(dashboard, "LINE_DEADLINE_S", 0.1)  # of this answer alone
                with pytest.raises(ArmFault):
                    await conversation.request("brake release")
            assert isinstance(await ends, ConnectionResetError)

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
            began_s = time.monotonic()
            assert await cause_of(arm.ready(3.0)) is ArmCause.LINK_LOST
            assert time.monotonic() - began_s < 20.0
            made.faults.clear("silent")
            await arm.ready(30.0)

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
    """As a link does that is cut while ur-rtde starts the program, which no person has stopped then."""

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


def test_a_stream_frozen_too_long_counts_as_a_lost_link(healthy_arm, until):
    """ur-rtde reports that it is connected all the while."""

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
                requested_s = time.monotonic()
                states.append(await arm.state())
                return requested_s > old_from_s and states[-1].age_s is not None

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


def test_an_arm_that_nobody_answers_for_is_a_fault_and_not_an_exception(host):
    async def run():
        async with UrArm(ArmSettings(host=host)) as arm:
            assert await cause_of(arm.ready(1.0)) is ArmCause.LINK_LOST
            state = await arm.state()
            assert state.age_s is None
            assert state.fault is not None
            assert await cause_of(arm.move_to("home")) is ArmCause.LINK_LOST
        assert await cause_of(arm.move_to("home")) is ArmCause.CLOSED

    asyncio.run(run())
