"""Modbus RTU link of the gripper: its RS-485 line at a serial port, or RTU frames over TCP.

Registers: Robotiq 2F-85 & 2F-140 instruction manual, chapter 4. Unverified on hardware.
"""

import asyncio
import logging
import termios
from collections.abc import Awaitable, Callable
from typing import Any, NoReturn

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException
from pymodbus.framer import FramerType
from pymodbus.pdu import ModbusPDU

from station.devices.gripper.errors import (
    GripperLinkLostError,
    GripperProtocolError,
    GripperSilentError,
    GripperUnreachableError,
)
from station.devices.gripper.link import Status
from station.messages import gripper as messages
from station.messages.message import Message
from station.settings.gripper import ModbusRtuSettings

_READ, _WRITE = 0x04, 0x10
_COMMAND, _STATUS, _COUNT = 0x03E8, 0x07D0, 3
_ACTIVATE, _GO_TO, _RELEASE_OPENS = 0x0100, 0x0800, 0x2000
_AMPERE_PER_COUNT = 0.01

_Client = AsyncModbusTcpClient | AsyncModbusSerialClient

# Every failure becomes a gripper error. Unhandled, pymodbus' own lines would go to stderr; a program that
# sets up logging still gets them.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class ModbusRtuLink:
    """One pymodbus client, made anew after each failure; retries and reconnecting are left to the verbs."""

    def __init__(self, settings: ModbusRtuSettings, answer_timeout_s: float) -> None:
        self._settings = settings
        self._answer_timeout_s = answer_timeout_s
        self._exchange = asyncio.Lock()
        self._client: _Client | None = None
        self._lost = asyncio.Event()
        self._received = b""
        self._wait_for_quiet = False

    @property
    def place(self) -> Message:
        """Describe the device at the other end and its address."""
        settings = self._settings
        address = settings.serial_port if settings.line == "serial" else f"{settings.host}:{settings.port}"
        return messages.PLACE_MODBUS_RTU(unit=settings.unit, address=address)

    async def status(self) -> Status:
        """Read the three status registers in one exchange."""
        async with self._exchange:
            return await self._status()

    async def reset(self) -> None:
        """Deactivate."""
        await self._write([0, 0, 0])

    async def begin_activation(self) -> None:
        """Raise the activation bit."""
        await self._write([_ACTIVATE | _RELEASE_OPENS])

    async def go_to(self, position: int, speed: int, force: int) -> None:
        """Move, all of it in one message."""
        await self._write([_ACTIVATE | _GO_TO | _RELEASE_OPENS, position, speed << 8 | force])

    async def halt(self) -> None:
        """Stop moving; the activation bit is written unchanged, because raising it would start an activation."""
        async with self._exchange:
            registers = await self._registers()
            await self._send([registers[0] & _ACTIVATE | _RELEASE_OPENS])

    async def close(self) -> None:
        """Close the connection."""
        if self._client:
            self._client.close()
            self._client = None

    async def _status(self) -> Status:
        gripper, fault, position = await self._registers()
        return Status(
            state=gripper >> 12 & 0x3,
            go_to=bool(gripper & _GO_TO),
            object_=gripper >> 14,
            fault=fault >> 8 & 0xF,
            echo=fault & 0xFF,
            position=position >> 8,
            current_a=(position & 0xFF) * _AMPERE_PER_COUNT,
        )

    async def _registers(self) -> list[int]:
        answer = await self._ask(
            _READ,
            lambda client: client.read_input_registers(_STATUS, count=_COUNT, device_id=self._settings.unit),
        )
        if len(answer.registers) != _COUNT:
            found = len(answer.registers)
            self._refuse(messages.WRONG_NUMBER(place=self.place, found=found, expected=_COUNT))
        return list(answer.registers)

    async def _write(self, values: list[int]) -> None:
        async with self._exchange:
            await self._send(values)

    async def _send(self, values: list[int]) -> None:
        await self._ask(_WRITE, lambda client: client.write_registers(_COMMAND, values, device_id=self._settings.unit))

    async def _ask(self, function: int, request: Callable[[_Client], Awaitable[ModbusPDU]]) -> ModbusPDU:
        client = await self._connected()
        self._received = b""
        asking = asyncio.ensure_future(_called(request, client))
        breaking = asyncio.ensure_future(self._lost.wait())
        try:
            await asyncio.wait({asking, breaking}, return_when=asyncio.FIRST_COMPLETED)
        except asyncio.CancelledError:
            # It ends within the time-out, and ended well it spares the halt that follows the wait for a quiet line.
            await asyncio.wait({asking, breaking}, return_when=asyncio.FIRST_COMPLETED)
            raise
        finally:
            if not asking.done() or asking.exception():
                self._drop()
            asking.cancel()
            breaking.cancel()
            await asyncio.gather(asking, breaking, return_exceptions=True)
        return self._checked(asking, function)

    def _checked(self, asked: asyncio.Future[ModbusPDU], function: int) -> ModbusPDU:
        """Return the answer, or raise the error for an invalid one."""
        if asked.cancelled() or isinstance(asked.exception(), ConnectionException):
            raise GripperLinkLostError(messages.LINK_LOST(place=self.place), messages.REMEDY_CABLE())
        if isinstance(asked.exception(), ModbusException) and self._received:
            self._refuse(messages.NOT_MODBUS_RTU(place=self.place, octets=self._received[:16].hex(" ")))
        if isinstance(asked.exception(), ModbusException):
            silent = messages.SILENT(place=self.place, limit_s=self._answer_timeout_s)
            raise GripperSilentError(silent, messages.REMEDY_SILENT_LINE())
        answer = asked.result()
        if answer.isError():
            self._refuse(messages.MODBUS_EXCEPTION(place=self.place, number=answer.exception_code))
        if answer.function_code != function:
            found = answer.function_code
            self._refuse(messages.WRONG_FUNCTION(place=self.place, found=found, expected=function))
        return answer

    def _refuse(self, cause: Message) -> NoReturn:
        self._drop()
        raise GripperProtocolError(cause, messages.REMEDY_LINE())

    def _drop(self) -> None:
        """Close after a failure: an answer may still be on its way."""
        self._wait_for_quiet = True
        if self._client:
            self._client.close()
            self._client = None

    async def _connected(self) -> _Client:
        if self._client:
            return self._client
        if self._wait_for_quiet and self._settings.line == "serial":
            # RTU answers carry no number: what is still on its way must not be taken for the next answer.
            await asyncio.sleep(self._answer_timeout_s)
        self._wait_for_quiet = False
        self._lost = asyncio.Event()
        client = self._make()
        try:
            connected = await client.connect()
        except termios.error:  # pyserial's, of a port that goes away while it is opened; it is no OSError
            connected = False
        if not connected:
            client.close()
            raise GripperUnreachableError(messages.UNREACHABLE(place=self.place), messages.REMEDY_SERIAL())
        self._client = client
        return client

    def _make(self) -> _Client:
        settings = self._settings
        lost = self._lost

        def on_connect(connected: bool) -> None:  # noqa: FBT001 (pymodbus' signature)
            if not connected:
                lost.set()

        def on_packet(sending: bool, data: bytes) -> bytes:  # noqa: FBT001 (pymodbus' signature)
            if not sending:
                self._received = data
            return data

        common: dict[str, Any] = {
            "framer": FramerType.RTU,
            "timeout": self._answer_timeout_s,
            "retries": 0,
            "reconnect_delay": 0,
            "trace_connect": on_connect,
            "trace_packet": on_packet,
        }
        if settings.line == "serial":
            return AsyncModbusSerialClient(settings.serial_port, baudrate=settings.baud_rate, **common)
        return AsyncModbusTcpClient(settings.host, port=settings.port, **common)


async def _called(request: Callable[[_Client], Awaitable[ModbusPDU]], client: _Client) -> ModbusPDU:
    """Convert an exception that pymodbus raises before its first await to an outcome like the others."""
    return await request(client)
