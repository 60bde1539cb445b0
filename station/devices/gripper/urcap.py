"""URCap link of the gripper: Robotiq's text socket on the UR controller, TCP 63352.

The socket carries no motor current. Unverified on hardware.
"""

import asyncio
import os
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import NoReturn

from station.devices.gripper.errors import (
    GripperEmergencyStopError,
    GripperLinkLostError,
    GripperNoValuesError,
    GripperProtocolError,
    GripperSilentError,
    GripperUnreachableError,
)
from station.devices.gripper.link import Status
from station.devices.unsent import discard_unsent
from station.messages import gripper as messages
from station.messages.message import Message, verbatim
from station.settings.gripper import UrcapSettings

_ACKNOWLEDGED = b"ack"
"""Comes without a newline."""
_LONGEST_ANSWER = 64
_CONNECT_TIMEOUT_S = 2.0
"""Includes time for one lost packet, which TCP repeats after a second."""


async def emergency_stopped() -> bool:
    """Return True: without an arm that reports its stops, a gripper without values is taken for emergency stopped."""
    return True


class UrcapLink:
    """One persistent connection to the URCap.

    Args:
        stopped: whether the robot is emergency stopped. The URCap answers `?` then, but also while the gripper's cable
            is broken or the arm is off.
    """

    def __init__(
        self,
        settings: UrcapSettings,
        answer_timeout_s: float,
        stopped: Callable[[], Awaitable[bool]] = emergency_stopped,
    ) -> None:
        self._settings = settings
        self._stopped = stopped
        self._answer_timeout_s = answer_timeout_s
        self._exchange = asyncio.Lock()
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    @property
    def place(self) -> Message:
        """Describe the device at the other end and its address."""
        return messages.PLACE_URCAP(address=f"{self._settings.host}:{self._settings.port}")

    async def status(self) -> Status:
        """Read the registers, the position after the object state: at rest the two belong together."""
        async with self._exchange:
            return Status(
                state=await self._get("STA", largest=3),
                go_to=await self._get("GTO", largest=1) == 1,
                echo=await self._get("PRE"),
                object_=await self._get("OBJ", largest=3),
                position=await self._get("POS"),
                fault=await self._get("FLT"),
                current_a=None,
            )

    async def reset(self) -> None:
        """Deactivate."""
        await self._set("ACT 0 GTO 0 ATR 0")

    async def begin_activation(self) -> None:
        """Raise the activation bit."""
        await self._set("ACT 1 ARD 1")

    async def go_to(self, position: int, speed: int, force: int) -> None:
        """Move, all of it in one message."""
        await self._set(f"POS {position} SPE {speed} FOR {force} GTO 1")

    async def halt(self) -> None:
        """Stop moving."""
        await self._set("GTO 0")

    async def close(self) -> None:
        """Close the connection."""
        if self._streams is None:
            return
        writer = self._streams[1]
        self._streams = None
        writer.transport.abort()
        with suppress(OSError):
            await writer.wait_closed()

    async def _set(self, assignments: str) -> None:
        async with self._exchange:
            answer = await self._ask(f"SET {assignments}\n".encode())
            if answer != _ACKNOWLEDGED:
                await self._refuse(assignments, answer)

    async def _get(self, name: str, largest: int = 255) -> int:
        answer = await self._ask(f"GET {name}\n".encode())
        words = answer.decode("ascii", errors="replace").split()
        if words == [name, "?"]:
            raise GripperEmergencyStopError if await self._stopped() else GripperNoValuesError
        if len(words) != 2 or words[0] != name or not words[1].isdecimal() or int(words[1]) > largest:
            await self._refuse(f"GET {name}", answer)
        return int(words[1])

    async def _refuse(self, request: str, answer: bytes) -> NoReturn:
        await self.close()
        wrong = messages.WRONG_ANSWER(place=self.place, answer=repr(answer), request=repr(request))
        raise GripperProtocolError(wrong, messages.REMEDY_PORT())

    async def _ask(self, request: bytes) -> bytes:
        streams = await self._connected()
        asking = asyncio.create_task(self._answer(*streams, request))
        try:
            return await asyncio.shield(asking)
        except asyncio.CancelledError:
            # It ends within the time-out; the halt that follows is then sent after it, on the same connection. Only a
            # second cancellation ends it.
            await asyncio.gather(asking, return_exceptions=True)
            raise

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, request: bytes) -> bytes:
        answer: bytes = b""
        try:
            async with asyncio.timeout(self._answer_timeout_s):
                writer.write(request)
                await writer.drain()
                while not (answer.endswith(b"\n") or answer == _ACKNOWLEDGED or len(answer) > _LONGEST_ANSWER):
                    answer += await _piece(reader)
        except TimeoutError:
            if answer:
                await self._refuse(request.decode().strip(), answer)
            await self.close()
            silent = messages.SILENT(place=self.place, limit_s=self._answer_timeout_s)
            raise GripperSilentError(silent, messages.REMEDY_SILENT_ROBOT()) from None
        except OSError as error:
            await self.close()
            reason = messages.CLOSED_BY_PEER() if isinstance(error, _ClosedByPeerError) else verbatim(str(error))
            lost = messages.LINK_LOST_BECAUSE(place=self.place, reason=reason)
            raise GripperLinkLostError(lost, messages.REMEDY_NETWORK()) from error
        except BaseException:
            await self.close()
            raise
        return answer

    async def _connected(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        if self._streams is None:
            try:
                async with asyncio.timeout(_CONNECT_TIMEOUT_S):
                    self._streams = await asyncio.open_connection(self._settings.host, self._settings.port)
            except OSError as error:
                away = messages.UNREACHABLE_BECAUSE(place=self.place, reason=_describe(error))
                raise GripperUnreachableError(away, messages.REMEDY_URCAP()) from error
            discard_unsent(self._streams[1])
        return self._streams


class _ClosedByPeerError(ConnectionError):
    """The other end closed the connection."""


def _describe(error: OSError) -> Message:
    """Describe the failure of the connection, without asyncio's own text around it."""
    number = error.errno or 0
    text = os.strerror(number) if number > 0 else error.strerror
    return verbatim(text) if text else messages.NO_ANSWER()


async def _piece(reader: asyncio.StreamReader) -> bytes:
    piece = await reader.read(_LONGEST_ANSWER)
    if not piece:
        raise _ClosedByPeerError
    return piece
