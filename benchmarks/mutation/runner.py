"""Runner of mutants: each in a forked process, with the room's own tests alone, the quickest killers first.

A mutant of a function gets, as the function's new code, into a process that has collected the tests, which takes
hundredths of a second. What changes a module's tables is imported anew with all that imports it, in a process that has
imported everything else, which takes tenths.
"""

import ast
import contextlib
import gc
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import resource
import signal
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import NamedTuple

import pytest
from hypothesis import Phase, settings

from .operators import Mutant

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # the code that is changed is the code that the tests import
_OURS = {"station", "plc_interface", "hmi", "tests", "benchmarks"}
_SIDE_BY_SIDE = 2
_LIMIT_S = 20
"""Of the processor's time: a mutant that takes more loops. One that waits is ended by the tests' own time-out."""
_LIKELY = 2
"""Tests that a module which is imported anew meets before all."""
_EXAMPLES = 10
"""Of a property, always the same ones."""
_PASSED, _FAILED, _NO_MODULE = 0, 1, 2


class Fate(StrEnum):
    """Outcome of a mutant."""

    KILLED = "killed"
    ALIVE = "alive"
    LATE = "late"
    """Killed by the time limit."""
    NO_MODULE = "no module"
    """It cannot even be imported, so no test has met it: not counted."""


class Changed(NamedTuple):
    """A mutant with its module's file, and the tree that it changes."""

    mutant: Mutant
    path: Path
    tree: ast.Module

    @property
    def function(self) -> str:
        """Its function, or class, with the module."""
        return f"{self.mutant.module}:{self.mutant.where}"

    def code(self) -> CodeType:
        """Apply the mutant, in this process for good, and return the module's code."""
        self.mutant.apply()
        return compile(ast.fix_missing_locations(self.tree), str(self.path), "exec")


class Order:
    """pytest plugin: tests that killed a mutant come first, then those that take least, so that a mutant dies early."""

    def __init__(self) -> None:
        self.took_s: dict[str, float] = {}
        self.kills: Counter[tuple[str, str]] = Counter()
        """By the mutant's function and the test; under no function those of all."""
        self.function: str = ""
        """Of the mutant that is met."""
        self.killer: int | None = None
        """Pipe of a process that meets a mutant: the first test that fails ends the process."""

    def note_kill(self, function: str, test: str) -> None:
        """Note that a test killed a mutant of a function."""
        self.kills[function, test] += 1
        self.kills["", test] += 1

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort them: what killed mutants of the same function, then of any."""
        items.sort(
            key=lambda item: (
                -self.kills[self.function, item.nodeid],
                -self.kills["", item.nodeid],
                self.took_s.get(item.nodeid, 0.0),
            )
        )

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note how long it took; where a mutant is met, end at the first that fails."""
        if report.when == "call":
            self.took_s[report.nodeid] = report.duration
        if report.failed and self.killer is not None:
            os.write(self.killer, report.nodeid.encode())
            os._exit(_FAILED)


def fates(todo: Sequence[Changed], tests: Sequence[str]) -> Iterator[tuple[Mutant, Fate]]:
    """Yield each mutant with its fate, as they end.

    Raises:
        SystemExit: the tests fail without any mutant, or this process has imported a module that is to be changed.
    """
    mutated = {each.mutant.module for each in todo}
    if imported := sorted(mutated & sys.modules.keys()):
        raise SystemExit(f"{', '.join(imported)}: imported already, so no mutant would be met; one room a process")
    order = _rehearse(tests, mutated)
    anew: list[Changed] = []
    for place, fate in _in_place(todo, tests, order):
        if fate is None:
            anew.append(todo[place])
        else:
            yield todo[place].mutant, fate
    for place, fate in _side_by_side(anew, order, lambda each: _import_and_meet(each, tests, order)):
        yield anew[place].mutant, fate


def _rehearse(tests: Sequence[str], mutated: Collection[str]) -> Order:
    """Run the tests without a mutant, import what they need, and return in what order they are quick.

    Args:
        tests: of the room.
        mutated: modules; they, and what imports them, are left for the processes that meet the mutants.
    """
    reading, writing = os.pipe()
    order = Order()

    def note() -> int:
        ended = _pytest(tests, order)
        apart = _importers(mutated)
        names = [name for name in sys.modules if name not in apart and name.partition(".")[0] != "tests"]
        with os.fdopen(writing, "w") as pipe:
            json.dump((names, order.took_s), pipe)
        return ended

    child = _fork(note)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        names, took_s = json.loads(pipe.read() or "[[], {}]")
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        raise SystemExit(f"without a mutant these fail: {' '.join(tests)}")
    for name in names:
        with contextlib.suppress(ImportError):  # made by another module, as six.moves
            importlib.import_module(name)
    order.took_s.update(took_s)
    return order


def _importers(modules: Collection[str]) -> set[str]:
    """Return these modules, and all loaded ones of the project that import one of them, directly or through others."""
    imports: dict[str, set[str]] = {}
    for name, module in sys.modules.items():
        path = getattr(module, "__file__", None)
        if path and name.partition(".")[0] in _OURS:
            imports[name] = {*_imported(ast.parse(Path(path).read_text(encoding="utf-8")))}
    found = set(modules)
    while more := {name for name, others in imports.items() if name not in found and others & found}:
        found |= more
    return found


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                yield from (each.name for each in node.names)
            case ast.ImportFrom(module=str() as module):
                yield module
                yield from (f"{module}.{each.name}" for each in node.names)
            case _:
                pass


def _in_place(todo: Sequence[Changed], tests: Sequence[str], order: Order) -> Iterator[tuple[int, Fate | None]]:
    """Let the tests, collected once, meet the mutants of functions; None for one that has to be imported."""
    reading, writing = os.pipe()
    called: set[tuple[str, str]] = set()
    """File and function of each call while the modules and tests were imported: in tables is what they returned."""

    class Loop:
        """pytest plugin: all mutants in place of one run."""

        @pytest.hookimpl(tryfirst=True)
        def pytest_runtestloop(self, session: pytest.Session) -> bool:
            sys.setprofile(None)
            apart = [each for each in todo if each.mutant.where and not _is_called(each, called)]
            others = [place for place, each in enumerate(todo) if each not in apart]
            places = [place for place in range(len(todo)) if place not in set(others)]
            with os.fdopen(writing, "w") as pipe:
                for place in others:
                    print(place, "-", file=pipe)
                for place, fate in _side_by_side(apart, order, lambda each: _meet(each, session, order)):
                    print(places[place], "-" if fate is Fate.NO_MODULE else fate.name, file=pipe, flush=True)
            return True

    def note(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call":
            called.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    def collect() -> int:
        sys.setprofile(note)
        return _pytest(tests, order, Loop())

    child = _fork(collect)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        for line in pipe:
            place, name = line.split()
            yield int(place), None if name == "-" else Fate[name]
    os.waitpid(child, 0)


def _is_called(changed: Changed, called: set[tuple[str, str]]) -> bool:
    """Return whether the mutant's function, or one around it, was called already; a class's own code always was."""
    return any(
        file == str(changed.path) and f"{changed.mutant.where}.".startswith(f"{name.replace('.<locals>', '')}.")
        for file, name in called
        if not name.startswith("<")
    )


def _meet(changed: Changed, session: pytest.Session, order: Order) -> int:
    if not _put_in_place(changed.code(), changed.path):
        return _NO_MODULE
    order.pytest_collection_modifyitems(session.items)
    for item, following in zip(session.items, [*session.items[1:], None], strict=True):
        session.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
    return _PASSED


def _put_in_place(module: CodeType, path: Path) -> bool:
    """Give every function of a file its new code, wherever it is referred to.

    Returns:
        Whether one differs: a default value is no part of a function's code.
    """
    differs = False
    gc.unfreeze()  # the tests' own conftest freezes what was collected, which hides it from `get_objects`
    codes = {(code.co_qualname, code.co_firstlineno): code for code in _codes(module)}
    for each in gc.get_objects():
        # By its type: `isinstance` gets the object's class from it, which one of canopen's answers with an error.
        if issubclass(type(each), FunctionType) and each.__code__.co_filename == str(path):
            code = codes[each.__code__.co_qualname, each.__code__.co_firstlineno]
            if code.co_freevars == each.__code__.co_freevars:
                differs |= code != each.__code__
                each.__code__ = code
    return differs


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


class _Mutated(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives a module its changed code."""

    def __init__(self, name: str, path: Path, code: CodeType) -> None:
        self._name, self._path, self._code = name, path, code

    def find_spec(self, fullname: str, path: object, target: object = None) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._name:
            return None
        return importlib.util.spec_from_file_location(fullname, self._path, loader=self)

    def exec_module(self, module: ModuleType) -> None:
        exec(self._code, module.__dict__)


def _import_and_meet(changed: Changed, tests: Sequence[str], order: Order) -> int:
    module = changed.mutant.module
    sys.meta_path.insert(0, _Mutated(module, changed.path, changed.code()))
    try:
        importlib.import_module(module)
    except Exception:  # noqa: BLE001 (any error that the change causes)
        return _NO_MODULE
    # What killed others of the function, collected alone, which is quicker than all.
    killers = sorted(order.kills, key=lambda kill: -order.kills[kill])
    likely = [test for function, test in killers if function == order.function][:_LIKELY] or [
        test for function, test in killers if not function
    ][:_LIKELY]
    if likely:
        _pytest(likely, order)
    return _pytest(tests, order)


def _side_by_side(
    todo: Sequence[Changed], order: Order, meet: Callable[[Changed], int]
) -> Iterator[tuple[int, Fate]]:  # fmt: skip
    """Fork a process for each mutant, a few at a time, and yield its place with its fate as it ends."""
    waiting = list(reversed(range(len(todo))))
    running: dict[int, tuple[int, int]] = {}
    while waiting or running:
        while waiting and len(running) < _SIDE_BY_SIDE:
            place = waiting.pop()
            reading, writing = os.pipe()
            order.function = todo[place].function
            child = _fork(lambda place=place, writing=writing: _limited(lambda: meet(todo[place]), order, writing))
            os.close(writing)
            running[child] = place, reading
        child, status = os.waitpid(-1, 0)
        place, reading = running.pop(child)
        with os.fdopen(reading) as pipe:
            for test in pipe.read().splitlines():
                order.note_kill(todo[place].function, test)
        yield place, _fate(os.waitstatus_to_exitcode(status))


def _limited(meet: Callable[[], int], order: Order, killer: int) -> int:
    resource.setrlimit(resource.RLIMIT_CPU, (_LIMIT_S, _LIMIT_S + 5))
    order.killer = killer
    return meet()


def _fate(code: int) -> Fate:
    if code == _PASSED:
        return Fate.ALIVE
    if code == -signal.SIGXCPU:
        return Fate.LATE
    return Fate.NO_MODULE if code > _FAILED else Fate.KILLED


def _pytest(tests: Sequence[str], *plugins: object) -> int:
    settings.register_profile(
        "mutation", derandomize=True, deadline=None, database=None, max_examples=_EXAMPLES,
        phases=(Phase.explicit, Phase.generate),
    )  # fmt: skip
    without = [f"-pno:{name}" for name in ("randomly", "cacheprovider", "xdist", "cov")]
    options = ["-x", "-q", "--tb=no", "--assert=plain", "--hypothesis-profile=mutation", *without]
    return pytest.main([*options, *tests], list(plugins))


def _fork(work: Callable[[], int]) -> int:
    """Run work in a process group of its own, silent; its exit code is what the work returns."""
    child = os.fork()
    if child:
        return child
    code = 3
    try:
        os.setpgid(0, 0)
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        code = work()
    finally:
        os._exit(code)
