"""Process handle of the ur-rtde process, for the driver."""

import asyncio
import contextlib
import os
import sys
import tempfile
from collections import deque
from typing import Self, TypeVar

from station.channel.client import ChannelClient
from station.channel.messages import ChannelError, ChannelMessage, DeadlineError
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import ArmRequest
from station.messages import arm as messages
from station.temporary_folder import make_temporary_folder

ReplyT = TypeVar("ReplyT", bound=ChannelMessage)
LAST_WORDS = 5
LONGEST_LINE = 65536
FOLDER = "fruit-station-arm"


class ArmProcess:
    """One start of the process; any failure of it ends it, and a new one is made."""

    def __init__(
        self, process: asyncio.subprocess.Process, channel: ChannelClient, folder: tempfile.TemporaryDirectory[str]
    ) -> None:
        self._process, self._channel, self._folder = process, channel, folder
        self._words: deque[str] = deque(maxlen=LAST_WORDS)
        self._listening = asyncio.create_task(self._listen(), name="words of the arm's process")
        # One for all requests: a wait for a process that is cancelled leaves its future behind (Python 3.11).
        self._ending = asyncio.create_task(process.wait(), name="end of the arm's process")

    @classmethod
    async def spawn(cls, host: str, frequency_hz: float) -> Self:
        """Start the process; it is not connected to anything yet.

        Raises:
            ArmFault: no process can be started.
        """
        folder = make_temporary_folder(FOLDER)
        endpoint = f"ipc://{folder.name}/0"  # short: a socket's path has 107 bytes at most
        try:
            process = await cls._start(endpoint, host, frequency_hz)
        except BaseException as error:
            folder.cleanup()
            if isinstance(error, OSError):
                raise ArmFault(ArmCause.LINK_LOST, messages.PROCESS_NOT_STARTED(reason=str(error))) from error
            raise
        return cls(process, ChannelClient(endpoint, "the arm's process"), folder)

    @staticmethod
    async def _start(endpoint: str, host: str, frequency_hz: float) -> asyncio.subprocess.Process:
        return await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",  # a folder named `station` in the working directory is not this package
            "-m",
            "station.devices.arm.process",
            endpoint,
            host,
            str(frequency_hz),
            str(os.getpid()),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            limit=LONGEST_LINE,
        )

    @property
    def pid(self) -> int:
        """Return the process's id."""
        return self._process.pid

    @property
    def ended(self) -> bool:
        """True once the process has ended."""
        return self._process.returncode is not None

    async def request(self, request: ArmRequest, reply: type[ReplyT], *, deadline_s: float) -> ReplyT:
        """Send a request to the process; the wait ends also when the process dies.

        Raises:
            ArmFault: no answer in time, the process has ended, or it refused.
        """
        asking = asyncio.create_task(self._channel.request(request, reply, deadline_s=deadline_s))
        try:
            await asyncio.wait({asking, self._ending}, return_when=asyncio.FIRST_COMPLETED)
            if asking.done():
                return asking.result()
        except DeadlineError as error:
            silent = messages.PROCESS_SILENT(limit_s=deadline_s, request=request.meaning)
            raise ArmFault(ArmCause.DEADLINE, silent) from error
        except ChannelError as error:
            raise ArmFault(ArmCause.DEADLINE, error.message) from error
        finally:
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)
        code, output = self._ending.result(), " / ".join(self._words)
        ended = messages.PROCESS_ENDED_AFTER(code=code, output=output) if output else messages.PROCESS_ENDED(code=code)
        raise ArmFault(ArmCause.LINK_LOST, ended)

    async def end(self) -> None:
        """Kill the process and remove its folder. Idempotent."""
        with contextlib.suppress(ProcessLookupError):
            if not self.ended:
                self._process.kill()
        await asyncio.wait({self._ending})
        await asyncio.gather(self._listening, return_exceptions=True)
        await self._channel.close()
        self._folder.cleanup()

    async def _listen(self) -> None:
        stderr = self._process.stderr
        while stderr is not None:
            try:
                line = await stderr.readline()
            except ValueError:
                continue
            if not line:
                return
            self._words.append(line.decode("utf-8", "replace").strip())
