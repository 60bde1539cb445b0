"""Kicks of the controller's watchdog: late ones are reported, which separates its stop from one on the pendant."""

import asyncio
import time
from types import SimpleNamespace

import pytest

from station.devices.arm import process as process_module
from station.devices.arm.diagnosis import PLAYING
from station.devices.arm.messages import Beat, Command
from station.devices.arm.process import UrRtdeProcess

WATCHDOG_HZ = 5.0
PERIOD_S = 1.0 / (4 * WATCHDOG_HZ)


class Controller:
    """Both of ur-rtde's connections, and a program that plays or does not."""

    def __init__(self):
        self.state, self.kicks, self.polls = PLAYING, 0, 0

    def kickWatchdog(self):  # noqa: N802 (ur-rtde's name)
        self.kicks += 1
        return True

    def getAsyncOperationProgressEx(self):  # noqa: N802
        return None

    def setTcp(self, _pose):  # noqa: N802
        return True

    def setPayload(self, _mass, _centre):  # noqa: N802
        return True

    def setWatchdog(self, _hz):  # noqa: N802
        return True

    def getRuntimeState(self):  # noqa: N802
        self.polls += 1
        return self.state

    def __getattr__(self, name):
        return {
            "getTimestamp": time.monotonic,
            "isConnected": lambda: True,
            "getRobotMode": lambda: 7,
            "getSafetyStatusBits": lambda: 1,
        }.get(name, lambda: [0.0] * 6)


@pytest.fixture
def prepared():
    """The process after its program was uploaded, and the controller."""
    process, controller = UrRtdeProcess("nowhere", 125.0), Controller()
    process._control = process._receive = controller
    process._set_up = Command(
        tool_centre_mm=(0, 0, 0), payload_kg=1, payload_centre_mm=(0, 0, 0), watchdog_hz=WATCHDOG_HZ
    )
    yield process, controller
    process._commander.shutdown()


def test_a_stop_by_the_watchdog_is_told_with_the_state_that_shows_it_also_after_a_kick_that_took_long(
    prepared, monkeypatch
):
    """The controller counts from some moment of the kick, and its stop comes between two polls of this process."""
    process, controller = prepared
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(process_module, "time", SimpleNamespace(monotonic=lambda: now.s))

    def kick():
        now.s += 0.7 / WATCHDOG_HZ
        controller.kicks += 1
        return True

    controller.kickWatchdog = kick

    async def kicks_late_after(share):
        """Return whether kicks are late with a stop `share` of the watchdog's limit after the kick's begin."""
        controller.state, controller.kicks, controller.polls, now.s = PLAYING, 0, 0, now.s + 100.0
        assert process._prepare()
        process._healthy_until_s, began_s = now.s + 0.5 / WATCHDOG_HZ, now.s
        kicking = asyncio.create_task(process._kick(0.001))
        while controller.polls < 2:
            await asyncio.sleep(0)
        kicking.cancel()
        await asyncio.gather(kicking, return_exceptions=True)
        assert controller.kicks == 1
        now.s, controller.state = began_s + share / WATCHDOG_HZ, PLAYING - 1
        return (await process.beat(Beat(healthy_for_s=30.0))).kicks_late

    async def run():
        assert await kicks_late_after(1.01)
        assert not await kicks_late_after(0.9)

    asyncio.run(run())


def test_a_watchdog_left_without_a_kick_is_told_until_the_program_begins_again(prepared):
    process, controller = prepared

    async def run():
        assert process._prepare()
        kicking = asyncio.create_task(process._kick(PERIOD_S))
        try:
            async with asyncio.timeout(30):
                while not (await process.beat(Beat(healthy_for_s=30.0))).kicks_late and controller.kicks < 3:
                    await asyncio.sleep(PERIOD_S)
                kicks = controller.kicks
                while not (await process.beat(Beat(healthy_for_s=0.0))).kicks_late:
                    await asyncio.sleep(PERIOD_S)
                assert controller.kicks <= kicks + 1, "a station that is not healthy kicks no more"
            controller.state = PLAYING + 1
            assert process._prepare()
            assert not (await process.beat(Beat(healthy_for_s=0.0))).kicks_late
        finally:
            kicking.cancel()
            await asyncio.gather(kicking, return_exceptions=True)

    asyncio.run(run())
