"""Supervisor: starts processes, restarts those that die or hang, and gives up after too many restarts.

What is given up stays down while the rest goes on: without the station's process the PLC interface still reports to the
PLC that the station is lost, which is the safe output. A person has to remove the cause and start the station again.
The supervisor's own supervisor is systemd. It feeds systemd's watchdog while all its programs notify it: if one of them
is silent, or if the supervisor itself hangs, nothing is fed.
"""

import asyncio
import contextlib
import logging
import os
import signal
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from station.errors import StationError
from station.messages import supervision as messages
from station.messages.message import Message, verbatim
from station.supervision.notify import EXTEND, PARENT_VARIABLE, SOCKET_VARIABLE, WATCHDOG_VARIABLE, notify
from station.supervision.restarts import RESTARTS_VARIABLE, Restarts, publish
from station.temporary_folder import make_temporary_folder

RESTARTS = 5
RESTARTS_WITHIN_S = 60.0
_LONGEST_MESSAGE_BYTES = 4096
_POLL_S = 0.1

log = logging.getLogger(__name__)


class SupervisionError(StationError):
    """A process cannot be kept running."""


@dataclass(frozen=True, slots=True)
class Program:
    """One process to supervise. It sends READY=1 when it serves, and WATCHDOG=1 while it makes progress.

    A start that takes longer than its limit sends EXTEND_TIMEOUT_USEC again and again: the time until its next message.
    """

    name: str
    command: tuple[str, ...]
    start_limit_s: float = 60.0
    watchdog_s: float = 10.0
    stop_limit_s: float = 30.0
    """From SIGTERM to SIGKILL."""
    output: Path | None = None
    """File for its output and messages; None for the supervisor's own output."""
    outlives: str | None = None
    """Name of an earlier program that is stopped before this one; None where this one is stopped before all earlier
    ones."""


class _Child:
    """A program's present process."""

    def __init__(self, program: Program, folder: Path, environment: Mapping[str, str]) -> None:
        self.program = program
        self.restarts: deque[float] = deque()
        self.restarts_in_all = 0
        self.process: asyncio.subprocess.Process | None = None
        self._address = folder / f"{program.name}.sock"
        self._environment = environment
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._listening.settimeout(0.0)
        self._listening.bind(str(self._address))
        self.ready = self.extended = self.given_up = False
        self._start_limit_s = program.start_limit_s
        self.heard_s = 0.0
        """Time of its start or last sign of progress; monotonic."""

    async def start(self) -> None:
        self.ready = self.extended = False
        self._start_limit_s = self.program.start_limit_s
        environment = {
            **self._environment,
            SOCKET_VARIABLE: str(self._address),
            WATCHDOG_VARIABLE: str(int(self.program.watchdog_s * 1e6)),
            PARENT_VARIABLE: str(os.getpid()),
        }
        # A session of its own: Ctrl-C on the terminal is the supervisor's, which ends the processes in their order.
        with contextlib.ExitStack() as stack:
            output = stack.enter_context(self.program.output.open("ab")) if self.program.output else None
            self.process = await asyncio.create_subprocess_exec(
                *self.program.command,
                env=environment,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self.heard_s = time.monotonic()

    def listen(self) -> None:
        """Receive the process's messages since the last call."""
        while True:
            try:
                message = self._listening.recv(_LONGEST_MESSAGE_BYTES)
            except BlockingIOError:
                return
            lines = message.split(b"\n")
            self.ready |= b"READY=1" in lines
            if self.ready and not {b"READY=1", b"WATCHDOG=1"}.isdisjoint(lines):
                self.heard_s = time.monotonic()
            for line in lines:
                if not self.ready and line.startswith(EXTEND) and line.removeprefix(EXTEND).isdigit():
                    self.extended, self.heard_s = True, time.monotonic()
                    self._start_limit_s = int(line.removeprefix(EXTEND)) / 1e6
                    notify(line.decode())  # systemd's limit on the unit's start is extended by the same

    def trouble(self) -> Message | None:
        """Return the process's fault."""
        if self.process is None:
            return messages.NOT_RUNNING()
        if self.process.returncode is not None:
            return messages.ENDED(how=_named(self.process.returncode))
        silent_s = time.monotonic() - self.heard_s
        if not self.ready and silent_s > self._start_limit_s:
            return messages.NOT_READY(limit_s=self._start_limit_s)
        if self.ready and silent_s > self.program.watchdog_s:
            return messages.NO_PROGRESS(limit_s=self.program.watchdog_s)
        return None

    async def stop(self, limit_s: float) -> None:
        """End the process and all its children by SIGTERM, after the limit by SIGKILL."""
        process = self.process
        if process is None:
            return
        if process.returncode is None:
            process.terminate()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(limit_s):
                    await process.wait()
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        await process.wait()

    def last_output(self) -> str:
        """Return the process's last output, or the place of its log."""
        if self.program.output is None:
            return "see its messages above"
        lines = self.program.output.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return f"{lines[-1] if lines else 'no output'} (see {self.program.output})"

    def close(self) -> None:
        self._listening.close()


class Supervisor:
    """Supervisor of programs, each started when the one before is ready, and ended in reverse but for `outlives`."""

    def __init__(self, programs: Sequence[Program], environment: Mapping[str, str] | None = None) -> None:
        self._programs = programs
        self._environment = dict(os.environ if environment is None else environment)
        self._children: list[_Child] = []
        self._restarts_file = Path()
        self._fed_s = 0.0

    def ready(self, name: str) -> bool:
        """Return whether a program's present process has reported that it serves."""
        return any(child.ready for child in self._children if child.program.name == name)

    async def run(self, on_ready: Callable[[], None], ended: asyncio.Event) -> None:
        """Start everything, call `on_ready` once all are ready for the first time, and supervise until `ended` is set.

        Raises:
            SupervisionError: a program did not become ready at first, or one was given up; in this case when everything
                has ended.
        """
        with make_temporary_folder("fruit-station-run") as folder:
            self._restarts_file = Path(folder) / "restarts.json"
            environment = {**self._environment, RESTARTS_VARIABLE: str(self._restarts_file)}
            self._children = [_Child(program, Path(folder), environment) for program in self._programs]
            self._publish_restarts()
            try:
                for child in self._children:
                    await child.start()
                    await self._until(child, ended)
                if not ended.is_set():
                    notify(f"STATUS=running: {', '.join(child.program.name for child in self._children)}")
                    on_ready()
                await self._keep(ended)
            finally:
                notify("STOPPING=1")
                await asyncio.shield(self._stop())
        if given_up := [child.program.name for child in self._children if child.given_up]:
            raise SupervisionError(messages.ALL_GIVEN_UP(processes=[verbatim(name) for name in given_up]))

    async def _until(self, child: _Child, ended: asyncio.Event) -> None:
        while not child.ready and not ended.is_set():
            child.listen()
            if trouble := child.trouble():
                raise SupervisionError(
                    messages.DID_NOT_START(process=child.program.name, trouble=trouble, output=child.last_output())
                )
            await self._poll(self._children, ended)

    async def _keep(self, ended: asyncio.Event) -> None:
        while not ended.is_set() and not all(child.given_up for child in self._children):
            for child in self._children:
                child.listen()
                if not child.given_up and (trouble := child.trouble()):
                    await self._restart(child, trouble)
            self._feed()
            await self._poll((), ended)

    def _feed(self) -> None:
        """Feed systemd's watchdog once all running programs, if there are any, have notified since the last time."""
        running = [child for child in self._children if not child.given_up]
        if running and all((child.ready or child.extended) and child.heard_s > self._fed_s for child in running):
            notify("WATCHDOG=1")
            self._fed_s = time.monotonic()

    async def _poll(self, children: Iterable[_Child], ended: asyncio.Event) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_POLL_S):
                await ended.wait()
        for child in children:
            child.listen()

    async def _restart(self, child: _Child, trouble: Message) -> None:
        now_s = time.monotonic()
        while child.restarts and now_s - child.restarts[0] > RESTARTS_WITHIN_S:
            child.restarts.popleft()
        await child.stop(0.0)
        if len(child.restarts) >= RESTARTS:
            child.given_up = True
            self._publish_restarts()
            given_up = messages.GIVEN_UP(
                process=child.program.name, trouble=trouble, restarts=RESTARTS, within_s=RESTARTS_WITHIN_S
            )
            notify(f"STATUS={given_up}")
            log.critical("%s", given_up)
            return
        log.error("%s", messages.RESTARTED(process=child.program.name, trouble=trouble))
        child.restarts.append(now_s)
        child.restarts_in_all += 1
        self._publish_restarts()
        notify(f"STATUS=running; {child.program.name} {trouble}: restart {child.restarts_in_all} since the start")
        await child.start()

    def _publish_restarts(self) -> None:
        counts = {c.program.name: Restarts(c.restarts_in_all, tuple(c.restarts), c.given_up) for c in self._children}
        publish(self._restarts_file, counts)

    async def _stop(self) -> None:
        names = [child.program.name for child in self._children]

        def rank(child: _Child) -> float:
            outlived = child.program.outlives
            return names.index(outlived) - 0.5 if outlived in names else names.index(child.program.name)

        for child in sorted(self._children, key=rank, reverse=True):
            await child.stop(child.program.stop_limit_s)
            child.close()


def _named(returncode: int) -> str:
    if returncode >= 0:
        return f"exit code {returncode}"
    with contextlib.suppress(ValueError):
        return signal.Signals(-returncode).name
    return f"signal {-returncode}"
