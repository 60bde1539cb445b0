"""URCap link of the gripper: Robotiq's text socket on the UR controller, TCP 63352.

The socket carries no motor current. Unverified on hardware.
"""

import asyncio
import os
from contextlib import suppress
from typing import NoReturn

from station.devices.gripper.errors import (
    GripperEmergencyStopError,
    GripperLinkLostError,
    GripperProtocolError,
    GripperSilentError,
    GripperUnreachableError,
)
from station.devices.gripper.link import Status
from station.settings.gripper import UrcapSettings

_ACKNOWLEDGED = b"ack"
"""Comes without a newline."""
_LONGEST_ANSWER = 64
_CONNECT_TIMEOUT_S = 2.0
"""Includes time for one lost packet, which TCP repeats after a second."""


class UrcapLink:
    """One persistent connection to the URCap."""

    def __init__(self, settings: UrcapSettings, answer_timeout_s: float) -> None:
        self._settings = settings
        self._answer_timeout_s = answer_timeout_s
        self._exchange = asyncio.Lock()
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    @property
    def place(self) -> str:
        """Describe the device at the other end and its address."""
        return f"URCap at {self._settings.host}:{self._settings.port}"

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
            raise GripperEmergencyStopError
        if len(words) != 2 or words[0] != name or not words[1].isdecimal() or int(words[1]) > largest:
            await self._refuse(f"GET {name}", answer)
        return int(words[1])

    async def _refuse(self, request: str, answer: bytes) -> NoReturn:
        await self.close()
        raise GripperProtocolError(
            f"{self.place} answered {answer!r} to {request!r}",
            "check that the address is the robot's and that nothing else uses the URCap's port",
        )

    async def _ask(self, request: bytes) -> bytes:
        reader, writer = await self._connected()
        answer = b""
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
            raise GripperSilentError(
                f"{self.place} did not answer within {self._answer_timeout_s:g} s",
                "check that the robot is powered and the gripper shows a steady LED",
            ) from None
        except OSError as error:
            await self.close()
            raise GripperLinkLostError(
                f"the connection to {self.place} broke ({error})",
                "check the network and the robot; the fingers may still be moving",
            ) from error
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
                raise GripperUnreachableError(
                    f"no connection to the {self.place} ({_describe(error)})",
                    "check the robot's address and network, and that the Robotiq URCap is installed and running",
                ) from error
        return self._streams


def _describe(error: OSError) -> str:
    """Describe the failure of the connection, without asyncio's own text around it."""
    number = error.errno or 0
    return os.strerror(number) if number > 0 else error.strerror or "no answer"


async def _piece(reader: asyncio.StreamReader) -> bytes:
    piece = await reader.read(_LONGEST_ANSWER)
    if not piece:
        raise ConnectionResetError("closed by the other end")
    return piece
