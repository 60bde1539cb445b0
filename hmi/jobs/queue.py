"""Long jobs of the pages: the station's own commands, each in a process with less priority than the cycle.

The station has no part in them: they read the records, and share only the processor with the cycle, at the lowest
priority.
"""

import asyncio
import contextlib
import json
import logging
import os
import shutil
import signal
import sys
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

from station.errors import StationError
from station.messages import jobs as messages
from station.messages.message import Message, verbatim

FOLDER = "panel_jobs"
LONGEST_S = 1800.0
"""Time limit of a job. An estimate."""
STORED_JOBS = 8
"""Number of the newest jobs whose files are stored."""
MOST_WAITING = 4
"""Maximum number of jobs that are waiting or running. An estimate."""
_STOP_S = 5.0
_LEAST_FREE_BYTES = 64 * 1024 * 1024
"""Free space of the disk below which no job begins. An estimate."""
_PROGRESS = "replayed.jsonl"
_CONFIGURATION = "job.station.yaml"
"""A job's own; no recipe's name has a dot."""
_MEDIA = {
    ".csv": "text/csv; charset=utf-8",
    ".parquet": "application/vnd.apache.parquet",
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
}

Kind = Literal["export", "lot_report", "whatif"]

log = logging.getLogger(__name__)


class JobFile(NamedTuple):
    """A file that a job has written."""

    path: Path
    media_type: str

    @property
    def size_bytes(self) -> int:
        """Return its size."""
        return self.path.stat().st_size


class JobError(StationError):
    """A job that cannot start, or does not exist."""


@dataclass(slots=True)
class Job:
    """One command of the queue."""

    id: str
    kind: Kind
    folder: Path
    arguments: Sequence[str]
    of: int = 0
    state: Literal["waiting", "running", "done", "failed", "ended"] = "waiting"
    message: Message | None = None
    task: asyncio.Task[None] | None = field(default=None, repr=False)

    @property
    def open(self) -> bool:
        """True until the job is finished."""
        return self.state in {"waiting", "running"}

    @property
    def files(self) -> tuple[JobFile, ...]:
        """Return its files, once it is done."""
        found = sorted(self.folder.iterdir()) if self.state == "done" else ()
        return tuple(JobFile(path, _MEDIA[path.suffix]) for path in found if path.suffix in _MEDIA)

    @property
    def done(self) -> int:
        """Return a what-if's progress from the file that it appends to; the first line is a heading."""
        if self.state == "done":
            return self.of
        with contextlib.suppress(OSError):
            return max(0, (self.folder / _PROGRESS).read_bytes().count(b"\n") - 1)
        return 0


class Jobs:
    """Queue that runs one job after the other, with the command line that gets the arguments.

    Args:
        station: the station's name, for reports.
    """

    def __init__(self, home: Path, station: str, command: Sequence[str] = (sys.executable, "-m", "station")) -> None:
        self._home, self._command = home, tuple(command)
        self._configuration = json.dumps({"home": str(home), "outbox": {"station": station}})
        self._jobs: dict[str, Job] = {}
        self._turn = asyncio.Lock()
        self._cleared = False

    def folder(self, files: Mapping[str, str] = MappingProxyType({})) -> Path:
        """Make a new job's folder, whose name is its id, with texts as files by their names.

        Raises:
            JobError: too many wait, or the disk is full.
        """
        if sum(job.open for job in self._jobs.values()) >= MOST_WAITING:
            raise JobError(messages.TOO_MANY(number=MOST_WAITING))
        folder = self._home / FOLDER / uuid.uuid4().hex
        try:
            # Of the start before. Once, as a folder has no job yet while its caller prepares it; and not at this start,
            # which may still fail because other pages of this home have the port.
            if not self._cleared:
                shutil.rmtree(folder.parent, ignore_errors=True)
                self._cleared = True
            folder.mkdir(parents=True)
            for name, text in {**files, _CONFIGURATION: self._configuration}.items():
                (folder / name).write_text(text, encoding="utf-8")
            free_bytes = shutil.disk_usage(folder).free
        except OSError as error:
            raise JobError(messages.NO_FOLDER(folder=str(folder.parent), error=error.strerror or str(error))) from error
        if free_bytes < _LEAST_FREE_BYTES:
            raise JobError(messages.DISK_FULL(free_mb=free_bytes // 1_000_000, folder=str(folder.parent)))
        return folder

    def begin(self, kind: Kind, folder: Path, arguments: Sequence[str], of: int = 0) -> Job:
        """Queue a job that writes its files into a folder from `folder`. Not idempotent.

        Args:
            of: number of steps, where it is known.
        """
        job = Job(folder.name, kind, folder, arguments, of)
        self._jobs[job.id] = job
        job.task = asyncio.create_task(self._run(job), name=f"job {kind}")
        self._forget()
        return job

    def get(self, job_id: str) -> Job:
        """Return a job.

        Raises:
            JobError: there is no such job.
        """
        if job_id not in self._jobs:
            raise JobError(messages.UNKNOWN())
        return self._jobs[job_id]

    async def end(self, job_id: str) -> None:
        """Cancel a job. Idempotent."""
        job = self.get(job_id)
        if job.task is not None and job.open:
            job.task.cancel()
            await asyncio.gather(job.task, return_exceptions=True)
            if job.open:  # cancelled before it ran at all
                job.state = "ended"

    async def close(self) -> None:
        """End the running job. Idempotent."""
        for job_id in list(self._jobs):
            await self.end(job_id)

    async def _run(self, job: Job) -> None:
        try:
            async with self._turn:
                job.state = "running"
                async with asyncio.timeout(LONGEST_S):
                    code, words = await self._run_command(job)
            job.state = "failed" if code else "done"
            job.message = verbatim(words) if words else None
        except TimeoutError:
            job.state, job.message = "failed", messages.LATE(limit_min=LONGEST_S / 60)
        except OSError as error:
            job.state, job.message = "failed", messages.NOT_STARTED(error=str(error.strerror))
        except asyncio.CancelledError:
            job.state = "ended"
            raise
        finally:
            if job.state != "done":
                shutil.rmtree(job.folder, ignore_errors=True)

    async def _run_command(self, job: Job) -> tuple[int, str]:
        """Return the exit code and the last output."""
        # It needs two settings of the site's, and reads no file that may be broken by now.
        environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith("STATION_")},
            "STATION_CONFIG": str(job.folder / _CONFIGURATION),
            "OMP_NUM_THREADS": "1",
        }
        process = await asyncio.create_subprocess_exec(
            *self._command,
            *job.arguments,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            env=environment,
            cwd=self._home,
            start_new_session=True,
        )
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, 19)
        try:
            _, stderr = await process.communicate()
        finally:
            await _ended(process)
        words = stderr.decode("utf-8", "replace").strip().splitlines()
        return process.returncode or 0, words[-1][:1000] if process.returncode and words else ""

    def _forget(self) -> None:
        over = [job for job in self._jobs.values() if not job.open]
        for job in over[: max(0, len(self._jobs) - STORED_JOBS)]:
            shutil.rmtree(job.folder, ignore_errors=True)
            del self._jobs[job.id]


async def _ended(process: asyncio.subprocess.Process) -> None:
    """Kill the process and all that it started, in any case."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_STOP_S):
                await process.wait()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    await process.wait()
