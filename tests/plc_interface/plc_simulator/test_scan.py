"""The scan loop's own part: an end that is asked for is not lost."""

import asyncio

import pytest
from pymodbus.exceptions import ModbusException

from plc_interface.plc_simulator.scan import Scanner
from plc_interface.registers.codec import WordOrder


@pytest.mark.parametrize("answered", [False, True])
def test_a_cancellation_that_the_library_loses_ends_the_exchange_all_the_same(monkeypatch, unused_port, answered):
    """Python 3.11's `wait_for` returns the answer instead, where both come at once."""

    async def losing(_self, _written):
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            if answered:
                return [0] * 200
        raise ModbusException("the connection is closed")

    monkeypatch.setattr(Scanner, "_exchanged", losing)
    monkeypatch.setattr(Scanner, "_laid_out", lambda _self, _outputs: [])

    async def scenario():
        exchange = asyncio.create_task(Scanner("127.0.0.1", unused_port, 1, WordOrder.LOW_FIRST).exchange({}))
        await asyncio.sleep(0)
        exchange.cancel()
        with pytest.raises(asyncio.CancelledError):
            await exchange

    asyncio.run(scenario())
