"""The scan loop's own part: a requested end is not lost, and a lost connection is made anew."""

import asyncio
import contextlib
import socket
import struct

import pytest
from pymodbus.exceptions import ModbusException

from plc_interface.plc_simulator.program import LineProgram
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


def test_after_a_connection_that_was_taken_and_reset_the_next_exchange_is_on_another(serve, unused_port):
    """As a switch does it that restarts: pymodbus takes such a connection for a live one, and waits on it."""

    async def scenario():
        async with serve() as rig, Scanner("127.0.0.1", unused_port, 1, WordOrder.HIGH_FIRST) as scanner:
            outputs = LineProgram().scan(None, 0.0, fruit_in_nest=False)
            with socket.create_server(("127.0.0.1", unused_port)) as listening:
                listening.settimeout(0)
                exchange = asyncio.create_task(scanner.exchange(outputs))
                taken, _ = await asyncio.get_running_loop().sock_accept(listening)
                taken.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                taken.close()
                assert await exchange is None
            relaying = await asyncio.start_server(to(rig.port), "127.0.0.1", unused_port)
            async with relaying:
                values = await scanner.exchange(outputs)
            assert values is not None, scanner.trouble
            assert not scanner.trouble

    asyncio.run(scenario())


def to(port):
    """Carry connections to another port."""

    async def carry(reader, writer):
        with contextlib.closing(writer):
            while data := await reader.read(4096):
                writer.write(data)

    async def relay(reader, writer):
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", port)
        with contextlib.suppress(asyncio.CancelledError):  # by the end of the test's loop
            await asyncio.gather(carry(reader, far_writer), carry(far_reader, writer))

    return relay
