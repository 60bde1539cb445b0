"""Rules and fixtures of every test: nothing may outlive it, and a missing tool is an error where CI=true."""

import asyncio
import functools
import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import pytest
import pytest_timeout
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from station.cli import main
from tests.ports import free_port, free_ports
from tests.tools import missing, required

SHARED = Path(__file__).resolve().parents[2] / "shared"
TOGETHER = (("hmi_pages",), ("hmi",), ("plc_interface/registers/generate", "runtime/test_plc_program.py"))
"""Tests that share what takes long to make: a whole station that runs, another one, the parsed Structured Text."""
GRACE_S = 3.0

settings.register_profile("busy machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy machine")

# As `station/__init__.py` has it for every process of the station; pytest's plugins import numpy before.
threadpool_limits(1, user_api="blas")

_TASKS: set[weakref.ref[asyncio.Task[Any]]] = set()


def pytest_configure() -> None:
    """Have programs under test heed Ctrl-C also where a shell runs these tests in its background, which ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection() -> None:
    """Leave all that is imported out of the garbage collector's rounds, which cost a tenth of the tests' time."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Collect what the tests leave."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep a folder's tests together, in any order, and begin a worker's share with tests of `TOGETHER`.

    A worker's share begins so many items after the one before (xdist's `worksteal`), and others take from its end: such
    tests stay with one worker, which makes what they share once.
    """
    order: dict[Path, int] = {}
    for item in items:
        order.setdefault(item.path.parent, len(order))
    items.sort(key=lambda item: order[item.path.parent])
    workers, count = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")), len(items)
    for number, names in enumerate(TOGETHER):
        paths = {Path(__file__).parent / name for name in names}
        tests = [item for item in items if not paths.isdisjoint((item.path, *item.path.parents))]
        moved = {id(item) for item in tests}
        items[:] = [item for item in items if id(item) not in moved]
        begin = number * count // workers
        items[begin:begin] = tests


def _remember_tasks() -> None:
    """Have every event loop note its tasks: to search the heap for them costs more than most tests."""
    plain = asyncio.BaseEventLoop.create_task

    def create_task(loop: asyncio.BaseEventLoop, *arguments: Any, **options: Any) -> asyncio.Task[Any]:
        task = plain(loop, *arguments, **options)
        _TASKS.add(weakref.ref(task, _TASKS.discard))
        return task

    asyncio.BaseEventLoop.create_task = create_task


_remember_tasks()


def _awaited(task: asyncio.Task[Any]) -> Iterator[str]:
    """Yield the lines where a task waits, from its own down to the innermost."""
    waiting: Any = task.get_coro()
    while waiting is not None:
        frame = getattr(waiting, "cr_frame", None) or getattr(waiting, "gi_frame", None)
        if frame is not None:
            yield f"  {frame.f_code.co_filename}:{frame.f_lineno} {frame.f_code.co_name}\n"
        waiting = getattr(waiting, "cr_await", None) or getattr(waiting, "gi_yieldfrom", None)


def _report_tasks_of_a_timeout() -> None:
    """Have the report of a test that takes too long show where its tasks wait, beside its threads."""
    threads_alone = pytest_timeout.dump_stacks

    def dump_stacks(terminal: Any) -> None:
        threads_alone(terminal)
        for task in [task for reference in list(_TASKS) if (task := reference()) is not None and not task.done()]:
            terminal.sep("~", title=f"Task {task.get_name()}")
            terminal.write("".join(_awaited(task)))

    pytest_timeout.dump_stacks = dump_stacks


_report_tasks_of_a_timeout()


def _has_children() -> bool:
    """Return whether there may be a child: reading /proc is fifty times quicker than a search of all processes."""
    try:
        children = [path.read_text() for path in Path("/proc/self/task").glob("*/children")]
    except OSError:  # a thread has just ended
        return True
    return not children or any(children)


class ProcessSnapshot(NamedTuple):
    """Threads, processes, ports and tasks that are alive in this process and below it."""

    threads: frozenset[threading.Thread]
    processes: frozenset[int]
    ports: frozenset[tuple[int, int]]
    tasks: frozenset[asyncio.Task[object]]

    @classmethod
    def now(cls) -> "ProcessSnapshot":
        me = psutil.Process()
        every = me.children(recursive=True) if _has_children() else []
        children = [child for child in every if child.status() != psutil.STATUS_ZOMBIE]
        listening = {
            (connection.fd, connection.laddr.port)
            for connection in me.net_connections(kind="inet")
            if connection.status == psutil.CONN_LISTEN
        }
        tasks = [reference() for reference in list(_TASKS)]
        return cls(
            frozenset(threading.enumerate()),
            frozenset(child.pid for child in children),
            frozenset(listening),
            frozenset(task for task in tasks if task is not None and not task.done()),
        )

    def beyond(self, before: "ProcessSnapshot") -> list[str]:
        """Return what is here now and was not before, in words."""
        new_threads = [thread.name for thread in self.threads - before.threads if thread.is_alive()]
        return [
            *(f"thread {name}" for name in new_threads),
            *(f"process {pid}" for pid in self.processes - before.processes),
            *(f"listening port {port}" for _, port in self.ports - before.ports),
            *(f"task {task.get_name()}" for task in self.tasks - before.tasks),
        ]


@pytest.fixture(autouse=True)
def nothing_left_behind() -> Iterator[None]:
    """Fail a test that leaves a thread, process, listening port or asyncio task."""
    before = ProcessSnapshot.now()
    yield
    deadline = time.monotonic() + GRACE_S
    while left := ProcessSnapshot.now().beyond(before):
        if time.monotonic() > deadline:
            pytest.fail(f"left behind: {', '.join(left)}", pytrace=False)
        threading.Event().wait(0.02)


@pytest.fixture(scope="session")
def chromium() -> str:
    """The path of the browser."""
    return required("chromium")


@pytest.fixture(scope="session")
def postgresql_programs() -> Path:
    """The folder of PostgreSQL's server programs."""
    from benchmarks.archive import postgres  # noqa: PLC0415 (psycopg takes long to load, and few tests need it)

    return postgres.programs() or missing("postgresql")


@pytest.fixture
def interned(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Notes the strings that Python code interns, as pathlib does; Python 3.12 before 3.12.7 keeps each for ever."""
    strings: list[str] = []
    intern = sys.intern

    def noted(string: str) -> str:
        strings.append(string)
        return intern(string)

    monkeypatch.setattr(sys, "intern", noted)
    return strings


@pytest.fixture
def unused_port() -> int:
    """A free loopback port."""
    return free_port()


@pytest.fixture
def unused_ports() -> Callable[[int], list[int]]:
    """Return a function that gives so many different free loopback ports."""
    return free_ports


@pytest.fixture(scope="session")
def real_images() -> Path:
    """The folder of real DIGIT images, which is beside the project and no part of it."""
    folder = SHARED / "data"
    if not (folder / "digit_presses").is_dir():
        pytest.skip("the folder of real DIGIT images is not beside this checkout")
    return folder


@pytest.fixture
def station_here(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the command line as its program does, in this process: to load it anew takes longer than what it does."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = ["station", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", command)
        capfd.readouterr()
        mask = os.umask(0o022)
        try:
            with pytest.raises(SystemExit) as ended:
                main()
        finally:
            os.umask(mask)
        assert isinstance(ended.value.code, int)
        return subprocess.CompletedProcess(command, ended.value.code, *capfd.readouterr())

    return run


@pytest.fixture
def analyze(
    station_here: Callable[..., subprocess.CompletedProcess[str]],
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `station analyze` in this process."""
    return functools.partial(station_here, "analyze")


@pytest.fixture
def analyze_apart() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `station analyze` as a user does."""

    def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "station", "analyze", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=90, check=False, **options)  # pyrefly: ignore[no-matching-overload] (the caller's options)

    return run


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 6 MB, where this user may make one."""
    place = tmp_path / "disk"
    place.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", place], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("this user may not mount a small disk")
    yield place
    subprocess.run(["umount", "--lazy", place], check=True)


@pytest.fixture
def card_address() -> str:
    """An address of this machine that is no loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # a datagram socket sends nothing by it
        except OSError:
            pytest.skip("this machine has no network card with an address")
        return probe.getsockname()[0]
