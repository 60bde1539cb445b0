"""The process that holds ur-rtde: it is killed, replaced, and ends with its caller."""

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import psutil
import pytest

from station.devices.arm.faults import ArmCause
from station.devices.arm.ur import UrArm
from tests.devices.arm.states import AWAY, cause_of, has_cause, moving


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


def test_garbage_on_the_wire_hurts_nobody_but_the_process(healthy_arm, until):
    async def run():
        async with healthy_arm() as (bench, arm):
            bench.faults.set("garbage")
            await until(lambda: has_cause(arm, ArmCause.LINK_LOST))
            bench.faults.clear("garbage")
            await arm.ready(15.0)
            await arm.move_to("accept")

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
