"""The simulated line against the real server and handshake."""

import asyncio

from plc_interface.plc_simulator.nest import LaidFruit
from plc_interface.plc_simulator.program import LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder


class HandNest:
    """A fruit lies there as soon as one is asked for."""

    async def arrive(self):
        return LaidFruit(kind="", damaged=None, recipe=0)

    async def leave(self):
        pass


def test_what_the_line_does_is_shown_with_the_numbers_of_the_active_alarms(serve):
    shown = []

    async def main():
        async with serve() as rig, Scanner("127.0.0.1", rig.port, 1, WordOrder.HIGH_FIRST) as scanner:
            simulator = LineSimulator(LineProgram(), scanner, HandNest(), Pace())
            simulator.on_scan = shown.append
            await simulator.run(1)
            rig.alarms = {2, 33}
            return await simulator.run(2)

    assert asyncio.run(main()).fruits == 2
    assert "waiting for result" in shown
    assert "waiting for result; active alarms: 2, 33" in shown
