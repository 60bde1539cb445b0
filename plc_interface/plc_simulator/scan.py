"""Scan loop: one Modbus exchange every few milliseconds, as a PLC's Modbus block does it."""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from typing import Self

from pymodbus.client import AsyncModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException

from plc_interface.registers.codec import RegisterValueError, WordOrder, decode, encode
from plc_interface.registers.map import CONTROL, GROUP_BY_NAME, MORE_STATUS, RESULT, STATUS
from plc_interface.registers.register import Register

ANSWER_LIMIT_S = 1.0
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # `trouble` holds its errors
_WITHOUT_ANSWER = (ConnectionException, ModbusIOException, TimeoutError, OSError)
"""Of a connection that a PLC's block would close: pymodbus holds some for connected that the peer has long reset."""
_READ = (*STATUS, *RESULT, *MORE_STATUS)
_FIRST = GROUP_BY_NAME["status"].address


class Scanner:
    """One connection to the station, re-established after a loss.

    Args:
        port: of its Modbus TCP.
        order: of the words in 32- and 64-bit values, as the station is set.
        one_round_trip: exchange by function code 23; by 16 and 3 where False.
    """

    def __init__(self, host: str, port: int, unit: int, order: WordOrder, *, one_round_trip: bool = True) -> None:
        self._address, self._unit, self._order = (host, port), unit, order
        self._one_round_trip = one_round_trip
        self._client: AsyncModbusTcpClient | None = None
        self.trouble = ""
        """Error of the last exchange; empty for none."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.cut()

    def cut(self) -> None:
        """Close the connection; the next exchange opens another. Idempotent."""
        if self._client is not None:
            self._client.close()
            self._client = None

    async def exchange(self, outputs: Mapping[str, int | str]) -> dict[str, int | float | str] | None:
        """Write the control block; return status, result and alarms, or None with the error in `trouble`."""
        try:
            try:
                words = await self._exchanged(self._laid_out(outputs))
            finally:
                _be_cancelled()
            values = {register.name: self._value(register, words) for register in _READ}
        except (ModbusException, RegisterValueError, TimeoutError, OSError) as error:
            self.trouble = f"{self._address[0]}:{self._address[1]}: {error}"
            if isinstance(error, _WITHOUT_ANSWER):
                self.cut()
            return None
        self.trouble = ""
        return values

    async def _exchanged(self, written: Sequence[int]) -> Sequence[int]:
        client = await self._connected()
        count = _READ[-1].end - _FIRST
        if self._one_round_trip:
            answer = await client.readwrite_registers(
                read_address=_FIRST, read_count=count, write_address=0, values=written, device_id=self._unit
            )
        else:
            answer = await client.write_registers(0, list(written), device_id=self._unit)
            if not answer.isError():
                answer = await client.read_holding_registers(_FIRST, count=count, device_id=self._unit)
        if answer.isError():
            raise ModbusException(f"refused with exception code {answer.exception_code}")
        return answer.registers

    async def _connected(self) -> AsyncModbusTcpClient:
        if self._client is not None and not self._client.connected:
            self.cut()
        if self._client is None:
            host, port = self._address
            client = AsyncModbusTcpClient(host, port=port, timeout=ANSWER_LIMIT_S, retries=0, reconnect_delay=0)
            if not await client.connect():
                client.close()
                raise ModbusException("nobody listens there; is the station running, and is this its address?")
            self._client = client
        return self._client

    def _laid_out(self, outputs: Mapping[str, int | str]) -> list[int]:
        return [word for register in CONTROL for word in encode(register, outputs[register.name], self._order)]

    def _value(self, register: Register, words: Sequence[int]) -> int | float | str:
        return decode(register, words[register.address - _FIRST : register.end - _FIRST], self._order)


def _be_cancelled() -> None:
    """End where pymodbus lost a cancellation: Python 3.11's `wait_for` drops one that comes with an answer."""
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError
