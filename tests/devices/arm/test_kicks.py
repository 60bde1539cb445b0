"""Whether the controller's watchdog was left without a kick: what tells its stop from one on the pendant."""

import asyncio
import time

from station.devices.arm.diagnosis import PLAYING
from station.devices.arm.messages import Beat, Command
from station.devices.arm.process import UrRtdeProcess

WATCHDOG_HZ = 5.0
PERIOD_S = 1.0 / (4 * WATCHDOG_HZ)


class Controller:
    """Both of ur-rtde's connections, and a program that plays or does not."""

    def __init__(self):
        self.state, self.kicks = PLAYING, 0

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
        return self.state

    def __getattr__(self, name):
        return {
            "getTimestamp": time.monotonic,
            "getRobotMode": lambda: 7,
            "getSafetyStatusBits": lambda: 1,
        }.get(name, lambda: [0.0] * 6)


def test_a_watchdog_left_without_a_kick_is_told_until_the_program_begins_again():
    async def run():
        process, controller = UrRtdeProcess("nowhere", 125.0), Controller()
        process._control = process._receive = controller
        process._set_up = Command(
            tool_centre_mm=(0, 0, 0), payload_kg=1, payload_centre_mm=(0, 0, 0), watchdog_hz=WATCHDOG_HZ
        )
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
            process._commander.shutdown()

    asyncio.run(run())
