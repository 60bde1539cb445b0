"""Modbus RTU in front of one gripper: framed as on RS-485, carried over TCP or over a pseudo-terminal.

Over TCP it is what Robotiq's RS-485 URCap and serial gateways offer: RTU frames with their CRC, not Modbus TCP.
"""

import asyncio
import os
import pty
import tty
from collections import deque
from contextlib import suppress

from station.twin.robotiq.listener import Listener, disturbed
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.rtu import LONGEST_FRAME, RequestFramer, answer


class RtuOverTcpServer(Listener):
    """RTU frames over TCP, any number of clients."""

    async def _session(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        framer = RequestFramer()
        while data := await reader.read(LONGEST_FRAME):
            for request in framer.feed(data, asyncio.get_running_loop().time()):
                reply = answer(request, self._gripper)
                if reply is not None:
                    writer.write(await disturbed(reply, self._gripper.faults))
            await writer.drain()


class RtuSerialServer:
    """RTU frames over a pseudo-terminal, which a serial driver opens like an RS-485 adapter's port."""

    def __init__(self, gripper: RobotiqGripper) -> None:
        self.path = ""
        """The device file to open, once started."""
        self._gripper = gripper
        self._framer = RequestFramer()
        self._ends: tuple[int, int] | None = None
        self._requests: deque[bytes] = deque()
        self._arrived = asyncio.Event()
        self._answering: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Open the line. The far end is held open too, so that the line outlives its users."""
        near, far = pty.openpty()
        # A new pseudo-terminal is in a console's mode, which echoes and translates bytes.
        tty.setraw(far)
        os.set_blocking(near, False)
        self.path = os.ttyname(far)
        self._ends = near, far
        asyncio.get_running_loop().add_reader(near, self._readable, near)
        self._answering = asyncio.create_task(self._answer(near), name=f"twin gripper {self.path}")

    async def stop(self) -> None:
        """Close the line."""
        if self._ends is None or self._answering is None:
            return
        asyncio.get_running_loop().remove_reader(self._ends[0])
        self._answering.cancel()
        await asyncio.gather(self._answering, return_exceptions=True)
        for end in self._ends:
            os.close(end)
        self._ends = self._answering = None

    def _readable(self, near: int) -> None:
        # Read also while the gripper is gone: what stays in the line would be answered afterwards.
        data = os.read(near, LONGEST_FRAME)
        if self._gripper.faults.gone(self._gripper.clock.now_s()):
            return
        self._requests.extend(self._framer.feed(data, asyncio.get_running_loop().time()))
        self._arrived.set()

    async def _answer(self, near: int) -> None:
        while True:
            await self._arrived.wait()
            self._arrived.clear()
            while self._requests:
                reply = answer(self._requests.popleft(), self._gripper)
                if reply is None:
                    continue
                reply = await disturbed(reply, self._gripper.faults)
                with suppress(BlockingIOError):  # a serial line loses what nobody reads
                    os.write(near, reply)
