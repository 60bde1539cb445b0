"""The function block in a scan loop over Modbus TCP, FC23, with the real server and handshake."""

import asyncio
import time

import pytest
from pymodbus.client import AsyncModbusTcpClient

from plc_interface.handshake.modes import Arming
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.map import GROUP_BY_NAME, MORE_STATUS, STATUS
from station.channel.line import Reason, Refusal

SCAN_S = 0.01
DEADLINE_S = 30.0


class Loop:
    """One PLC program's cycle."""

    def __init__(self, plc, client):
        self.plc, self.client = plc, client
        self.read = STATUS[0].address, MORE_STATUS[-1].end - STATUS[0].address

    async def scan(self, **inputs):
        plc = self.plc
        plc.inputs.update(inputs)
        answer = await self.client.readwrite_registers(
            read_address=self.read[0], read_count=self.read[1], write_address=GROUP_BY_NAME["control"].address,
            values=plc.block["registers"], device_id=1,
        )  # fmt: skip
        assert not answer.isError(), answer
        plc.library.now_s = time.monotonic()
        plc.block(station=answer.registers, **plc.inputs)
        await asyncio.sleep(SCAN_S)

    async def until(self, name, wanted=True, **inputs):
        """Scan until an output has a value."""
        self.plc.inputs.update(inputs)
        async with asyncio.timeout(DEADLINE_S):
            while self.plc.block[name] != wanted:
                await self.scan()


@pytest.mark.parametrize("order", WordOrder)
def test_fruits_recipe_refusal_and_a_station_that_dies(serve, make_plc, no_contact, order):
    async def main():
        plc = make_plc(order)
        block = plc.block
        block({**plc.inputs, "connected": False})
        async with serve(order) as rig:
            client = AsyncModbusTcpClient("127.0.0.1", port=rig.port, retries=0, reconnect_delay=0)
            assert await client.connect()
            loop = Loop(plc, client)
            plc.inputs.update(accept_simulated=True, heartbeat_timeout=1.0)
            for fruit, outcome in (
                (7, {}),
                (8, no_contact),
                (9, {"outcome": "FAIL", "reasons": (Reason.AREA_OVER_LIMIT,)}),
            ):
                rig.outcome = outcome
                await loop.until("ready", inspect=False)
                await loop.until("done", inspect=True, fruit_id=fruit, encoder=fruit << 16)
                assert block["passed"] == (fruit == 7)
                assert (block["refused"], block["timed_out"]) == (False, False)
                assert (block["result"]["trigger_id"], block["result"]["encoder"]) == (fruit, fruit << 16)
                await loop.until("done", wanted=False, inspect=False)
            assert [trigger for trigger, _, _ in rig.accepted] == [7, 8, 9]

            await loop.until("recipe_done", change_recipe=True, recipe_number=12)
            assert rig.commands == [("change_recipe", 12)]

            rig.alarms = {1, 33, 40}
            rig.beat()
            await loop.scan()
            assert (block["status"]["alarms"], block["status"]["alarms_33_to_64"]) == (1, 1 << 7 | 1)

            rig.refusal = Refusal.RECORDS_FULL
            await loop.until("ready")
            await loop.until("done", inspect=True, fruit_id=10)
            assert (block["refused"], block["refusal"], block["passed"]) == (True, 10, False)
            rig.refusal = None
            await loop.until("ready", inspect=False)

            rig.inspection_s = 60.0
            await loop.until("busy", inspect=True, fruit_id=11)
            rig.answers = False
            await loop.until("alive", wanted=False)
            assert not block["busy"]
            assert not block["passed"]
            rig.answers = True
            await loop.until("alive", inspect=False)
            for _ in range(50):
                await loop.scan()
                assert not block["passed"]
            client.close()
            assert rig.state.queue == ()

    asyncio.run(main())


@pytest.mark.parametrize("loss", ["connection", "heartbeat"])
def test_a_loss_that_no_scan_has_seen_arms_again_with_enable_held(serve, make_plc, loss):
    async def main():
        plc = make_plc(WordOrder.HIGH_FIRST)
        async with serve() as rig:
            client = AsyncModbusTcpClient("127.0.0.1", port=rig.port, retries=0, reconnect_delay=0)
            assert await client.connect()
            loop = Loop(plc, client)
            plc.inputs.update(accept_simulated=True, heartbeat_timeout=10.0)
            plc.block({**plc.inputs, "connected": False})
            await loop.until("ready", inspect=False)
            if loss == "connection":
                client.close()
            async with asyncio.timeout(DEADLINE_S):
                while rig.state.arming is not Arming.WITHDRAWN:
                    await asyncio.sleep(SCAN_S)
            if loss == "connection":
                assert await client.connect()
            await loop.scan()
            assert not plc.block["ready"]
            assert plc.block["alive"]
            await loop.until("ready")
            await loop.until("done", inspect=True, fruit_id=7)
            assert plc.block["passed"]
            client.close()

    asyncio.run(main())
