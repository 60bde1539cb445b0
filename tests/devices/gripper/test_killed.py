"""Fingers that close for a process that is killed: they stop soon, wherever that process had sent them."""

import asyncio
import signal
import sys
import time

import pytest

from station.devices.gripper.robotiq import STRIDE_MM

SPEED_MM_S, FROM_MM, TO_MM = 20.0, 45.0, 5.0
COUNT_MM = 85 / 227
POLLED_EVERY_S = 0.02
"""The fingers' time from one question of the driver to the next, of which a busy machine would take more."""
CLOSES = f"""
import asyncio, sys
from station.devices.gripper.robotiq import make_gripper
from station.settings.gripper import GripperSettings
settings = GripperSettings.model_validate_json(sys.argv[1])
asyncio.run(make_gripper(settings).move_to_width({TO_MM}, {SPEED_MM_S}, 20.0))
"""


@pytest.mark.parametrize("after_mm", [4.0, 9.5, 17.0])
def test_the_fingers_of_a_killed_process_stop_within_a_stride(on, after_mm):
    async def scenario(rig):
        def width_mm():
            return rig.twin.opening_mm(rig.clock.now_s()) - rig.settings.calibration.finger_offset_mm

        await rig.driver.move_to_width(FROM_MM, 100.0, 20.0)
        arguments = ("-c", CLOSES, rig.settings.model_dump_json())
        closing = await asyncio.create_subprocess_exec(sys.executable, *arguments)
        while width_mm() > FROM_MM - after_mm:
            await asyncio.sleep(0.002)
        closing.send_signal(signal.SIGKILL)
        await closing.wait()
        killed_mm = width_mm()
        rest_s = time.monotonic() + 2 * STRIDE_MM / SPEED_MM_S
        while time.monotonic() < rest_s:
            await asyncio.sleep(0.02)
        assert killed_mm - width_mm() <= STRIDE_MM + COUNT_MM
        assert width_mm() > TO_MM + STRIDE_MM, "it was killed on its way"

    on("urcap", scenario)


def test_they_do_not_stop_on_the_way_that_they_are_sent_stride_by_stride(on_wire):
    async def scenario(rig):
        await rig.driver.move_to_width(FROM_MM, 100.0, 20.0)
        places, write, status = [], rig.twin.write, rig.driver.link.status
        rig.clock.hold()

        def written(command):
            places.append((rig.twin.status().object_, command.position))
            write(command)

        async def polled():
            rig.clock.skip(POLLED_EVERY_S)
            return await status()

        rig.twin.write, rig.driver.link.status = written, polled
        moved = await rig.driver.move_to_width(TO_MM, SPEED_MM_S, 20.0)
        assert moved.reading.width_mm == pytest.approx(TO_MM, abs=COUNT_MM)
        targets = [position for _, position in places]
        assert targets == sorted(targets)
        assert len(targets) > (FROM_MM - TO_MM) / STRIDE_MM
        assert {state for state, _ in places[1:]} == {0}, "each target is renewed before it is reached"

    on_wire(scenario)
