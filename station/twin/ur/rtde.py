"""The RTDE server, port 30004, protocol version 2.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide".
"""

import asyncio
import math
import random
import socket
import struct
from typing import TYPE_CHECKING, Any, cast

from station.twin.faults import CommonFault
from station.twin.ur.outputs import Getter, output
from station.twin.ur.registers import TYPE_CODES, input_type

if TYPE_CHECKING:  # the controller makes these itself
    from station.twin.ur.controller import UrController

PORT = 30004
FREQUENCY_HZ = 500.0
LEAST_FREQUENCY_HZ = 1.0
LARGEST_PACKAGE_BYTES = 65535
"""A package's size field has 16 bits."""
SLOW_READER_S = 10.0
# With the kernel's larger buffer a client that does not read would be noticed much later.
SEND_BUFFER_BYTES = 32768
HEADER = struct.Struct(">HB")
PROTOCOL_VERSION = 2

REQUEST_VERSION, CONTROLLER_VERSION, DATA, OUTPUTS, INPUTS, START, PAUSE = (ord(letter) for letter in "VvUOISP")


class OutputRecipe:
    """Output recipe: the variables that a client subscribed to, packed in one go."""

    def __init__(self, identity: int, sources: list[tuple[str, Getter]], divider: int) -> None:
        self._getters = [getter for _, getter in sources]
        codes = "".join(TYPE_CODES[kind] for kind, _ in sources)
        self._struct = struct.Struct(f">HBB{codes}")
        self._identity = identity
        self.divider = divider

    @property
    def size_bytes(self) -> int:
        """The size of one data package, its header included."""
        return self._struct.size

    def package(self) -> bytes:
        """One data package of now."""
        values: list[Any] = []
        for getter in self._getters:
            values.extend(getter())
        return self._struct.pack(self._struct.size, DATA, self._identity, *values)


class InputRecipe:
    """Input recipe: the inputs that a client's package carries."""

    def __init__(self, names: list[str], kinds: list[str]) -> None:
        self._fields = [(name, 6 if kind.startswith("VECTOR6") else 1) for name, kind in zip(names, kinds, strict=True)]
        self._struct = struct.Struct(">" + "".join(TYPE_CODES[kind] for kind in kinds))

    def unpack(self, payload: bytes) -> list[tuple[str, Any]]:
        """Names and values of one package.

        ur-rtde's forward kinematics sends more than its recipe has; what is too much is let go.

        Raises:
            struct.error: the package is shorter than the recipe.
        """
        values = iter(self._struct.unpack_from(payload))
        return [(name, next(values) if n == 1 else tuple(next(values) for _ in range(n))) for name, n in self._fields]


class RtdeConnection(asyncio.Protocol):
    """One client, in `connections` while it is connected."""

    def __init__(self, controller: "UrController", connections: "set[RtdeConnection]") -> None:
        self._controller, self._connections = controller, connections
        self._buffer = bytearray()
        self._transport: asyncio.Transport | None = None
        self._inputs: dict[int, InputRecipe] = {}
        self._output: OutputRecipe | None = None
        self._started = False
        self._blocked_since_s: float | None = None
        self.lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._last = b""
        self._noise = random.Random(0)  # noqa: S311 (garbage on purpose)
        self._handlers = {
            REQUEST_VERSION: self._request_version,
            CONTROLLER_VERSION: self._controller_version,
            OUTPUTS: self._setup_outputs,
            INPUTS: self._setup_inputs,
            START: self._start,
            PAUSE: self._pause,
            DATA: self._data,
        }

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take a client in."""
        self._transport = transport = cast("asyncio.Transport", transport)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        transport.set_write_buffer_limits(high=SEND_BUFFER_BYTES)
        self._connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a client and what it claimed."""
        self._connections.discard(self)
        self._controller.registers.release(self)
        self.lost.set_result(None)

    def pause_writing(self) -> None:
        """The client does not read."""
        self._blocked_since_s = self._controller.clock.now_s()

    def resume_writing(self) -> None:
        """The client reads again."""
        self._blocked_since_s = None

    @property
    def blocked(self) -> bool:
        """True while the client does not read."""
        return self._blocked_since_s is not None

    @property
    def _silent(self) -> bool:
        faults = self._controller.faults
        return faults.active("silent") or faults.active("rtde_silent")

    def cut(self) -> None:
        """Drop the client without a word."""
        if self._transport is not None:
            self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Take in bytes and answer every whole package."""
        if self._silent:
            return
        self._buffer += data
        while len(self._buffer) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._buffer)
            # A size of 0 would take nothing from the buffer, and this loop would never end.
            if size < HEADER.size:
                self.cut()
                return
            if len(self._buffer) < size:
                return
            payload = bytes(self._buffer[HEADER.size : size])
            del self._buffer[:size]
            handler = self._handlers.get(kind)
            if handler is None:
                continue
            try:
                handler(payload)
            except (struct.error, UnicodeDecodeError, KeyError):
                self.cut()
                return

    def publish(self, tick: int, now_s: float) -> None:
        """Send the package that is due in this cycle, unless the client is behind."""
        if self._blocked_since_s is not None:
            if now_s - self._blocked_since_s > SLOW_READER_S:
                self.cut()
            return
        if self._output is None or not self._started or tick % self._output.divider:
            return
        faults = self._controller.faults
        if self._silent:
            return
        if faults.active(CommonFault.GARBAGE):
            self._write(self._noise.randbytes(64))
            return
        if not faults.active(CommonFault.STUCK) or not self._last:
            self._last = self._output.package()
        self._write(self._last)

    def _write(self, data: bytes) -> None:
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        delay_s = self._controller.faults.amount(CommonFault.DELAYED)
        if delay_s > 0:
            asyncio.get_running_loop().call_later(delay_s, _write_if_open, transport, data)
        else:
            transport.write(data)

    def _reply(self, kind: int, payload: bytes) -> None:
        self._write(HEADER.pack(HEADER.size + len(payload), kind) + payload)

    def _request_version(self, payload: bytes) -> None:
        (version,) = struct.unpack(">H", payload)
        self._reply(REQUEST_VERSION, bytes([version == PROTOCOL_VERSION]))

    def _controller_version(self, _payload: bytes) -> None:
        self._reply(CONTROLLER_VERSION, struct.pack(">4I", *self._controller.version))

    def _setup_outputs(self, payload: bytes) -> None:
        (frequency_hz,) = struct.unpack_from(">d", payload)
        names = [name for name in payload[8:].decode("ascii").split(",") if name]
        sources = [output(self._controller, name) for name in names]
        kinds = ["NOT_FOUND" if source is None else source[0] for source in sources]
        found = [source for source in sources if source is not None]
        accepted = len(found) == len(names) > 0 and LEAST_FREQUENCY_HZ <= frequency_hz < math.inf
        if accepted:
            recipe = OutputRecipe(1, found, max(1, round(FREQUENCY_HZ / frequency_hz)))
            accepted = recipe.size_bytes <= LARGEST_PACKAGE_BYTES
            if accepted:
                self._output = recipe
        self._reply(OUTPUTS, bytes([accepted]) + ",".join(kinds).encode())

    def _setup_inputs(self, payload: bytes) -> None:
        names = [name for name in payload.decode("ascii").split(",") if name]
        kinds = [self._input_kind(name) for name in names]
        accepted = bool(names) and all(kind in TYPE_CODES for kind in kinds)
        identity = len(self._inputs) + 1 if accepted else 0
        if accepted:
            self._inputs[identity] = InputRecipe(names, kinds)
        self._reply(INPUTS, bytes([identity]) + ",".join(kinds).encode())

    def _input_kind(self, name: str) -> str:
        kind = input_type(name)
        if kind is None:
            return "NOT_FOUND"
        fieldbus_on = self._controller.faults.active("registers_in_use")
        return kind if self._controller.registers.claim(name, self, fieldbus_on=fieldbus_on) else "IN_USE"

    def _start(self, _payload: bytes) -> None:
        self._started = self._output is not None
        self._reply(START, bytes([self._started]))

    def _pause(self, _payload: bytes) -> None:
        self._started = False
        self._reply(PAUSE, b"\x01")

    def _data(self, payload: bytes) -> None:
        if payload:
            self._controller.write_inputs(self._inputs[payload[0]].unpack(payload[1:]))


def _write_if_open(transport: asyncio.Transport, data: bytes) -> None:
    if not transport.is_closing():
        transport.write(data)
