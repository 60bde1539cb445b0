"""The simulated line against the real server and handshake."""

import asyncio

from plc_interface.plc_simulator.nest import LaidFruit
from plc_interface.plc_simulator.program import Decision, LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.channel.line import PackmlState

PATIENCE_S = 30


class HandNest:
    """A fruit is there as soon as one is requested."""

    def __init__(self):
        self.arrived = self.left = 0

    async def arrive(self):
        self.arrived += 1
        return LaidFruit(kind="", damaged=None, recipe=0)

    async def leave(self):
        self.left += 1


def test_what_the_line_does_is_shown_with_the_numbers_of_the_active_alarms(serve):
    shown = []

    async def main():
        async with serve() as rig, Scanner("127.0.0.1", rig.port, 1, WordOrder.HIGH_FIRST) as scanner:
            rig.packml_state = PackmlState.IDLE
            simulator = LineSimulator(LineProgram(), scanner, HandNest(), Pace())
            simulator.on_scan = shown.append
            await simulator.run(1)
            rig.alarms = {2, 33}
            return await simulator.run(2)

    assert asyncio.run(main()).fruits == 2
    assert "waiting for result" in shown
    assert "waiting for result; active alarms: 2, 33" in shown


def test_a_decided_fruit_stays_in_the_nest_until_the_arm_has_left_and_the_next_one_need_not_wait_for_that(serve):
    async def main():
        nest, decided = HandNest(), []
        async with (
            asyncio.timeout(PATIENCE_S),
            serve() as rig,
            Scanner("127.0.0.1", rig.port, 1, WordOrder.HIGH_FIRST) as scanner,
        ):
            simulator = LineSimulator(LineProgram(), scanner, nest, Pace())
            simulator.on_passage = lambda passage, _fruit: decided.append((passage.decision, nest.arrived, nest.left))
            running = asyncio.create_task(simulator.run(2))
            while len(decided) < 2:
                await asyncio.sleep(0.01)
            await asyncio.sleep(0.3)
            assert decided == [(Decision.PASS, 1, 0), (Decision.PASS, 2, 0)]
            assert (nest.left, running.done()) == (0, False), "the station is still at it"
            rig.packml_state = PackmlState.IDLE
            await running
        assert nest.left == 1

    asyncio.run(main())
