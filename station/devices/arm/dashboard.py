"""Dashboard client of the controller: one short connection for each conversation.

Source of commands and answers: Universal Robots, "Dashboard Server e-Series".
"""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from dataclasses import dataclass

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.unsent import discard_unsent
from station.messages import arm as messages

PORT = 29999
LINE_DEADLINE_S = 2.5
"""Longest wait for a connection, and for each line of an answer, s; an estimate."""
LONGEST_LINE = 4096
"""Bytes of an answer's line at most; an estimate."""
LONGEST_SHOWN = 160
"""Characters of an answer that a message quotes at most."""


@dataclass(frozen=True, slots=True)
class DashboardFacts:
    """Facts that the controller reports about itself."""

    version: str
    serial_number: str
    model: str
    robot_mode: str
    safety_status: str
    remote: bool


class DashboardConversation:
    """Requests and replies on one connection."""

    def __init__(self, host: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._host, self._reader, self._writer = host, reader, writer

    async def read_line(self) -> str:
        """Read the next line.

        Raises:
            ArmFault: none came in time, or it is no text.
        """
        try:
            async with asyncio.timeout(LINE_DEADLINE_S):
                line = await self._reader.readline()
        except (TimeoutError, OSError, ValueError) as error:
            raise ArmFault(ArmCause.LINK_LOST, messages.DASHBOARD_SILENT(host=self._host)) from error
        if not line.endswith(b"\n") or not line.isascii():
            raise ArmFault(ArmCause.LINK_LOST, messages.DASHBOARD_PROTOCOL(host=self._host))
        return line.decode("ascii").strip()

    async def request(self, command: str) -> str:
        """Send a line and return the reply.

        Raises:
            ArmFault: none came in time.
        """
        try:
            self._writer.write(command.encode("ascii") + b"\n")
            await self._writer.drain()
        except OSError as error:
            raise ArmFault(ArmCause.LINK_LOST, messages.DASHBOARD_CLOSED(host=self._host)) from error
        return await self.read_line()

    async def facts(self) -> DashboardFacts:
        """Read all facts for the driver and the device check.

        Raises:
            ArmFault: an answer did not come in time.
        """
        return DashboardFacts(
            version=(await self.request("PolyscopeVersion")).removeprefix("URSoftware "),
            serial_number=await self.request("get serial number"),
            model=await self.request("get robot model"),
            robot_mode=(await self.request("robotmode")).removeprefix("Robotmode: "),
            safety_status=(await self.request("safetystatus")).removeprefix("Safetystatus: "),
            remote="true" in await self.request("is in remote control"),
        )


@contextlib.asynccontextmanager
async def dashboard(host: str) -> AsyncIterator[DashboardConversation]:
    """Connect and read the greeting.

    Raises:
        ArmFault: no answer, or none in the protocol.
    """
    try:
        async with asyncio.timeout(LINE_DEADLINE_S):
            reader, writer = await asyncio.open_connection(host, PORT, limit=LONGEST_LINE)
    except (TimeoutError, OSError) as error:
        unknown = isinstance(error, socket.gaierror)
        detail = messages.DASHBOARD_UNKNOWN_HOST if unknown else messages.DASHBOARD_ABSENT
        raise ArmFault(ArmCause.LINK_LOST, detail(address=f"{host}:{PORT}")) from error
    discard_unsent(writer)
    try:
        conversation = DashboardConversation(host, reader, writer)
        greeting = await conversation.read_line()
        if "Dashboard Server" not in greeting:
            other = messages.DASHBOARD_OTHER(address=f"{host}:{PORT}", greeting=repr(greeting[:LONGEST_SHOWN]))
            raise ArmFault(ArmCause.LINK_LOST, other)
        yield conversation
    finally:
        writer.transport.abort()
