"""Register access by name over Modbus TCP: the lower half of the client."""

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any, Self

from pymodbus.client import AsyncModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU

from plc_interface.client.errors import ReferencesError, RequestRefusedError, UnreachableError
from plc_interface.registers.codec import WordOrder, decode, encode, is_invalid
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME, GROUPS, MAP_VERSION, REFERENCES, map_checksum
from plc_interface.registers.register import Register

EXCEPTIONS = {
    1: "it does not serve that function, or not for this client: see modbus.writers",
    2: "a register is not in the map or is read-only: compare the map's version",
    3: "a value has no meaning there, or half of one was written",
    4: "it failed: see its log",
    6: "another client holds the right to write, or the write key is not set",
    11: "no station has this unit identifier: compare modbus.unit",
}


class RegisterLink:
    """One connection to the interface. Belongs to the event loop that it is used in."""

    def __init__(
        self,
        host: str,
        port: int = 5020,
        *,
        unit: int = 1,
        order: WordOrder = WordOrder.HIGH_FIRST,
        timeout_s: float = 1.0,
    ) -> None:
        """Prepare a connection; nothing is sent yet.

        Args:
            host: name or address of the interface.
            port: its TCP port.
            unit: its Modbus unit identifier.
            order: of the words of 32- and 64-bit values, as the station is configured.
            timeout_s: for the connection and for each answer; nothing is ever repeated.
        """
        self._where = f"{host}:{port}"
        self._unit, self._order = unit, order
        self._client = AsyncModbusTcpClient(host, port=port, timeout=timeout_s, retries=0, reconnect_delay=0)
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def connect(self) -> None:
        """Connect, and check the reference values.

        Raises:
            UnreachableError: there is no answer.
            ReferencesError: see `check_references`.
        """
        if not await self._client.connect():
            self._client.close()
            raise UnreachableError(f"nobody answers Modbus TCP at {self._where}: is the interface running there?")
        try:
            await self.check_references()
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        """Close the connection. Idempotent; the station disarms if this client was the writer."""
        self._client.close()
        await asyncio.sleep(0)

    async def read(self, name: str) -> Any:
        """Return one register's value; None for the register's own "there is none".

        Args:
            name: of the register map; KeyError for another.
        """
        register = BY_NAME[name]
        words = await self._read(register.address, register.words)
        return self._value(register, words)

    async def read_groups(self, first: str, last: str | None = None) -> dict[str, Any]:
        """Return the values of one group, or of neighbouring groups, from one read.

        Args:
            first: the group's name.
            last: the last group's name; they must fit 125 registers and follow each other without a gap.
        """
        begin, end = GROUP_BY_NAME[first], GROUP_BY_NAME[last or first]
        words = await self._read(begin.address, end.end - begin.address)
        groups = GROUPS[GROUPS.index(begin) : GROUPS.index(end) + 1]
        return {
            register.name: self._value(register, words[register.address - begin.address :][: register.words])
            for group in groups
            for register in group.registers
        }

    async def write(self, values: Mapping[str, float | str]) -> None:
        """Write registers by name; neighbouring ones go into one request.

        Args:
            values: by register name.

        Raises:
            RegisterValueError: a register cannot hold its value; nothing was written.
            RequestRefusedError: the interface refused.
        """
        runs: list[tuple[int, list[int]]] = []
        for register in sorted((BY_NAME[name] for name in values), key=lambda one: one.address):
            words = encode(register, values[register.name], self._order)
            if runs and runs[-1][0] + len(runs[-1][1]) == register.address:
                runs[-1][1].extend(words)
            else:
                runs.append((register.address, list(words)))
        for address, words in runs:
            await self._ask(
                f"write registers {address} to {address + len(words) - 1}",
                lambda address=address, words=words: self._client.write_registers(address, words, device_id=self._unit),
            )

    async def check_references(self) -> None:
        """Compare the reference registers and the map's version; where its checksum is another, its extent.

        Raises:
            ReferencesError: names the cause: another word order, swapped bytes, an address that is off by one, another
                version of the map, a map that has less than this client's.
        """
        group = GROUP_BY_NAME["identity"]
        count = BY_NAME["reference_u64"].end - group.address
        words = await self._try_read(group.address, count)
        fault = "" if words is None else self._difference(words)
        if words is None or fault:
            for offset in (1, -1):
                shifted = await self._try_read(group.address + offset, count)
                if shifted is not None and not self._difference(shifted):
                    raise ReferencesError(
                        f"{self._where} has every register {'above' if offset > 0 else 'below'} where the map has it, "
                        "by one: something between mixes zero-based and one-based addresses"
                    )
            if words is None:
                raise ReferencesError(f"{self._where} has no registers at {group.address}: it is no fruit station")
            raise ReferencesError(f"{self._where}: {fault}")
        identity = {
            name: self._value(BY_NAME[name], words[BY_NAME[name].address - group.address :][: BY_NAME[name].words])
            for name in ("map_version", "map_checksum")
        }
        if identity["map_version"] != MAP_VERSION:
            raise ReferencesError(
                f"{self._where} has version {identity['map_version']} of the map, this client has {MAP_VERSION}: "
                "update one"
            )
        if identity["map_checksum"] != map_checksum():
            await self._check_blocks()

    async def _check_blocks(self) -> None:
        """Check that a map of the same version has every register of this client's: it may only have more."""
        for group in GROUPS:
            if await self._try_read(group.address, group.words) is None:
                raise ReferencesError(
                    f"{self._where} has an older map, without all registers {group.address} to {group.end - 1}: "
                    "update the station"
                )

    def _difference(self, words: Sequence[int]) -> str:
        """Describe the error of the references in the identity block's words; empty for none."""
        for order in (self._order, *(other for other in WordOrder if other is not self._order)):
            if _references_match(words, order):
                if order is self._order:
                    return ""
                return f"it has the other word order, {order}: set the client's order, or the station's"
        swapped = [word >> 8 | (word & 0xFF) << 8 for word in words]
        if any(_references_match(swapped, order) for order in WordOrder):
            return "the two bytes of each register are swapped: something between does not speak Modbus as it must"
        return f"register {BY_NAME['reference_u16'].address} reads {words[1]:#06x} and not 0x1234: no fruit station"

    def _value(self, register: Register, words: Sequence[int]) -> Any:
        value = decode(register, words, self._order)
        return None if is_invalid(register, value) else value

    async def _try_read(self, address: int, count: int) -> Sequence[int] | None:
        try:
            return await self._read(address, count)
        except RequestRefusedError as error:
            if error.code != 2:  # a map's end is what is looked for here
                raise
            return None

    async def _read(self, address: int, count: int) -> Sequence[int]:
        response = await self._ask(
            f"read registers {address} to {address + count - 1}",
            lambda: self._client.read_holding_registers(address, count=count, device_id=self._unit),
        )
        if len(response.registers) != count:
            raise UnreachableError(f"{self._where} gave {len(response.registers)} registers, asked for {count}")
        return response.registers

    async def _ask(self, what: str, request: Any) -> ModbusPDU:
        task = asyncio.current_task()
        cancelled_before = task.cancelling() if task else 0
        try:
            async with self._turn:
                response: ModbusPDU = await request()
        except ModbusException as error:
            raise UnreachableError(
                f"{self._where} did not answer when asked to {what} ({error}): connect again and look at the result "
                "registers before the next trigger"
            ) from error
        # `asyncio.wait_for` of Python 3.11, by which pymodbus waits, loses a cancellation that comes with the answer:
        # a heartbeat went on after it, and `close` waited for its end for ever.
        if task and task.cancelling() > cancelled_before:
            raise asyncio.CancelledError
        if response.isError():
            code = response.exception_code
            why = EXCEPTIONS.get(code, "see its log")
            raise RequestRefusedError(f"{self._where} refused to {what} with exception {code:02}: {why}", code)
        return response


def _references_match(words: Sequence[int], order: WordOrder) -> bool:
    base = GROUP_BY_NAME["identity"].address
    return all(
        encode(BY_NAME[name], expected, order) == tuple(words[BY_NAME[name].address - base : BY_NAME[name].end - base])
        for name, expected in REFERENCES.items()
    )
