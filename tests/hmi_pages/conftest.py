"""One running station on a simulated bench, with its pages, and a browser: each test leaves them as they were."""

import asyncio
import contextlib
import functools
import http.client
import itertools
import json
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import psutil
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from benchmarks.reliability.quick_recipe import few_steps
from hmi.api.tokens import ApiTokens
from hmi.web.roles import Role
from hmi.web.user_store import UserStore
from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    CommandName,
    Line,
    Noted,
    Outcome,
    Published,
    StationState,
)
from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.settings.recipe import load_recipes, recipe_files
from station.settings.recipe_text import with_values
from station.twin.console import ask
from station.vocabulary import Reason
from tests.chromium import ARGUMENTS
from tests.eventually import eventually as poll
from tests.hosts import fresh_host
from tests.ports import free_port
from tests.quick_recipes import NUMBERS
from tests.slower_mode import SLOWER_MODE

PATIENCE_S = 120.0
PATIENT_HANDSHAKE = {"begin_deadline_s": 10.0, "station_lost_after_s": 30.0, "plc_heartbeat_timeout_s": 30.0}
"""For a station that a busy machine lets wait: one that is lost for a second has its fruit called off."""
LINE = Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=())
PEOPLE = {"Ada": Role.ADMIN, "Quin": Role.QUALITY, "Rosa": Role.QUALITY, "Max": Role.MAINTENANCE}
PIN = "735192"
MEASURED = frozenset(list(Reason)[: list(Reason).index(Reason.REFERENCE_BAD)]) - {Reason.NO_CONTACT}
"""The reasons that the fruit itself gives, after some steps."""
_LASTING: list[int] = []
"""Processes of the site, which all modules share."""
T = TypeVar("T")
eventually = functools.partial(poll, patience_s=PATIENCE_S)


@pytest.fixture(scope="session", name="eventually")
def eventually_fixture() -> Callable[..., Any]:
    """Poll until something is so."""
    return eventually


def quick_recipes(folder: Path) -> Path:
    """The shipped recipes, comments and all, with few, hasty steps."""
    folder.mkdir()
    shipped = load_recipes()
    for file in recipe_files():
        text = file.read_text(encoding="utf-8")
        if file.stem in NUMBERS:
            text, _ = with_values(text, few_steps(shipped[file.stem]), str(file))
        (folder / file.name).write_text(text, encoding="utf-8")
    return folder


@dataclass
class Site:
    """A running station with its pages."""

    configuration: Configuration
    console: int
    address: str
    fruit: list[Outcome] = field(default_factory=list)
    """Inspected, in order."""
    soft: Outcome | None = None
    """One that was measured and is no PASS."""
    _triggers: Any = field(default_factory=lambda: itertools.count(1))

    @property
    def home(self) -> Path:
        return self.configuration.home

    def twin(self, **request: Any) -> Any:
        return ask("127.0.0.1", self.console, request)

    def over_channel(self, work: Callable[[ChannelClient], Awaitable[T]], endpoint: str = "") -> T:
        """Run requests to the station as the PLC interface does, or over another endpoint."""
        where = endpoint or line_endpoint(self.configuration.handshake, self.home)

        async def run() -> T:
            async with ChannelClient(where, "the station") as client:
                return await work(client)

        with ThreadPoolExecutor(1) as thread:  # the browser's own event loop runs in this one
            return thread.submit(asyncio.run, run()).result()

    def over_the_panel(self, work: Callable[[ChannelClient], Awaitable[T]]) -> T:
        return self.over_channel(work, panel_endpoint(self.configuration.hmi, self.home))

    def state(self) -> StationState:
        return self.over_channel(lambda client: client.request(LINE, StationState, deadline_s=20))

    def order(self, command: CommandName, argument: int = 0) -> CommandDone:
        request = Command(command=command, argument=argument)
        return self.over_channel(lambda client: client.request(request, CommandDone, deadline_s=40))

    def ready(self) -> bool:
        """Return whether fruit is accepted; if not, reset as a person does: on a busy machine late moves stop it."""
        if self.state().ready:
            return True
        self.order(CommandName.RESET)
        return False

    def inspect(self, *, bruised: bool, seed: int = 1) -> Outcome:
        """One fruit, from a ready station to an acknowledged outcome."""
        self.twin(do="fruit", kind="strawberry", seed=seed, bruised=bruised)
        eventually(self.ready)

        async def steps(client: ChannelClient) -> Outcome:
            size = {"fruit_length_mm_x10": 480, "size_class": 3} if bruised else {}
            request = Begin(trigger_id=next(self._triggers), encoder=7, lot="LOT 1", **size)
            reply = await client.request(request, BeginReply, deadline_s=20)
            assert reply.sequence is not None, reply
            outcome = await client.request(AwaitOutcome(sequence=reply.sequence), Outcome, deadline_s=PATIENCE_S)
            await client.request(Published(outcome=outcome), Noted, deadline_s=20)
            await client.request(Acknowledged(sequence=outcome.sequence), Noted, deadline_s=20)
            return outcome

        outcome = self.over_channel(steps)
        self.fruit.append(outcome)
        self.twin(do="remove")
        return outcome

    @contextlib.contextmanager
    def manual_mode(self) -> Iterator[None]:
        assert self.order(CommandName.SET_MODE, 3).done
        try:
            yield
        finally:
            assert self.order(CommandName.SET_MODE, 1).done


def start_program(command: list[str], is_ready: Callable[[str], bool], log: Path) -> subprocess.Popen[str]:
    """A process of the station's command line, once one of its lines is the one that is waited for."""
    with log.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "station", *command], stdout=subprocess.PIPE, stderr=errors, text=True
        )
    assert process.stdout is not None
    for line in process.stdout:
        if is_ready(line):
            return process
    raise AssertionError(f"{command} ended: {log.read_text()}")


@pytest.fixture(autouse=True)
def nothing_left_behind() -> None:
    """A browser begins threads and processes of its own when it likes: leftovers are checked after the module."""


@pytest.fixture(scope="module", autouse=True)
def nothing_left_by_the_module() -> Iterator[None]:
    """Fail the last test of a module that leaves a thread or a process."""

    def living() -> tuple[set[int], set[threading.Thread]]:
        children = psutil.Process().children(recursive=True)
        running = {child.pid for child in children if child.is_running() and child.status() != psutil.STATUS_ZOMBIE}
        return running, {thread for thread in threading.enumerate() if thread.is_alive()}

    processes, threads = living()
    yield
    deadline_s = time.monotonic() + PATIENCE_S
    while (left := (living()[0] - processes - set(_LASTING), living()[1] - threads)) != (set(), set()):
        assert time.monotonic() < deadline_s, f"left behind: {left}"
        time.sleep(0.05)


@pytest.fixture(scope="package")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    host = fresh_host()
    file, port = folder / "station.yaml", free_port()
    values = {
        "home": str(folder / "h"),
        "recipes_folder": str(quick_recipes(folder / "recipes")),
        "gripper": {
            "urcap": {"host": host},
            "modbus_rtu": {"host": host},
            "answer_timeout_s": 4.0,
            "move_margin_s": 8.0,
        },
        "camera": {"oldest_s": 3.0, "twin": {"port": free_port()}},
        "handshake": PATIENT_HANDSHAKE,
        "metrics": {"port": free_port()},
        "modbus": {"port": free_port()},
        "hmi": {"port": port, "idle_s": 3600.0},
        "records": {"free_reserve_mb": 1, "accepted_share": 1.0},
        "service": {
            "bench": True,
            "retry_longest_s": 0.5,
            "patience": 10.0,
            "inspection_deadline_s": None,
            "uncalibrated": "allow",
        },
    }
    file.write_text(json.dumps(values))
    people = UserStore(folder / "h" / "hmi")
    people.begin("Ada", PIN)
    for name, role in PEOPLE.items():
        people.put(name, role, PIN)
    consoles: list[int] = []

    def twin_is_ready(line: str) -> bool:
        if line.startswith("console"):
            consoles.append(int(line.split(":")[1]))
        return line.startswith("running")

    processes: list[subprocess.Popen[str]] = []
    try:
        arguments = ["--config", str(file)]
        processes.append(
            start_program(["twin", "--bench", "--console", "0", *arguments], twin_is_ready, folder / "twin.log")
        )
        processes.append(
            start_program(["service", *arguments], lambda line: line.startswith("running"), folder / "service.log")
        )
        with (folder / "others.log").open("w") as log:
            for name in (["hmi"], ["plc", "run"]):
                command = [sys.executable, "-m", "station", *name, *arguments]
                processes.append(subprocess.Popen(command, stdout=log, stderr=log, text=True))
        _LASTING.extend(process.pid for process in processes)
        made = Site(load_configuration(file, {}), consoles[0], f"http://127.0.0.1:{port}")
        eventually(lambda: _answers(made.address) or _ended(processes, folder / "others.log"))
        made.twin(do="remove")
        made.twin(**SLOWER_MODE)
        eventually(lambda: made.order(CommandName.RESET).done)
        assert made.order(CommandName.CHANGE_RECIPE, 1).done
        yield made
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGTERM)
        for process in reversed(processes):
            process.communicate(timeout=40)


def _ended(processes: list[subprocess.Popen[str]], log: Path) -> bool:
    assert all(process.poll() is None for process in processes), log.read_text()
    return False


def _answers(address: str) -> bool:
    with contextlib.suppress(OSError), urllib.request.urlopen(address, timeout=5) as answer:
        return answer.status == 200
    return False


@pytest.fixture(scope="package")
def orchard(site: Site) -> Site:
    """A station that has inspected a good fruit and a soft one, which is tried again where a device failed."""
    site.inspect(bruised=False, seed=3)
    for _ in range(5):
        outcome = site.inspect(bruised=True, seed=2)
        if outcome.reasons and MEASURED.issuperset(outcome.reasons):
            site.soft = outcome
            return site
    raise AssertionError(site.fruit)


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Browser]:
    expect.set_options(timeout=1000 * PATIENCE_S)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield browser
        browser.close()


@dataclass
class Answer:
    """Of the HTTP API."""

    status: int
    body: Any
    headers: dict[str, str]


@pytest.fixture(scope="package")
def api(site: Site) -> Callable[..., Answer]:
    """Sends one request to the pages' server, as a program does."""

    def send(
        method: str,
        path: str,
        body: bytes | None = None,
        *,
        token: str = "",
        json_body: Any = None,
        **headers: str,
    ) -> Answer:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        if token:
            named["authorization"] = f"Bearer {token}"
        if json_body is not None:
            body = json.dumps(json_body).encode()
            named["content-type"] = "application/json"
        host, _, port = site.address.removeprefix("http://").partition(":")
        connection = http.client.HTTPConnection(host, int(port), timeout=PATIENCE_S)
        try:
            connection.request(method, path, body, named)
            answer = connection.getresponse()
            raw = answer.read()
        finally:
            connection.close()
        found = {name.lower(): value for name, value in answer.getheaders()}
        is_json = found.get("content-type", "").startswith("application/json")
        return Answer(answer.status, json.loads(raw) if is_json else raw.decode("utf-8", "replace"), found)

    return send


@pytest.fixture(scope="package")
def token_of(site: Site) -> Callable[[str, Role], str]:
    """Makes a token as `station api-token add` does."""
    return ApiTokens(site.home / "hmi").add


@dataclass
class Person:
    """A person at a panel."""

    context: BrowserContext
    page: Page
    address: str

    def go(self, path: str) -> Page:
        answer = self.page.goto(f"{self.address}{path}")
        assert answer is not None
        assert answer.status == 200, f"{path}: {answer.status}"
        return self.page

    def log_in(self, name: str) -> None:
        page = self.go("/people")
        token = page.locator("input[name=csrf]").first.get_attribute("value")
        answer = self.context.request.post(
            f"{self.address}/people/log-in", form={"csrf": token or "", "name": name, "pin": PIN, "back": "/"}
        )
        assert answer.ok, answer.text()


@pytest.fixture
def panel(site: Site, browser: Browser) -> Iterator[Callable[..., Person]]:
    """Opens a browser of its own, 1280 x 800 by default; what it writes to its console fails the test."""
    contexts: list[BrowserContext] = []
    complaints: list[str] = []

    def come(name: str = "", width: int = 1280, height: int = 800, locale: str = "en") -> Person:
        context = browser.new_context(viewport={"width": width, "height": height}, locale=locale)
        context.set_default_timeout(1000 * PATIENCE_S)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda message: complaints.append(message.text) if "Content Security Policy" in message.text else None,
        )
        person = Person(context, page, site.address)
        if name:
            person.log_in(name)
        return person

    yield come
    for context in contexts:
        context.close()
    assert not complaints
