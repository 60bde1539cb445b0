"""A whole station on a simulated bench, its pages as a process of their own, and a browser to look at them."""

import asyncio
import contextlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import psutil
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from playwright.sync_api import Browser, BrowserContext, Page, Playwright, sync_playwright
from playwright.sync_api import Error as BrowserError
from playwright.sync_api import TimeoutError as BrowserTimeout

from hmi.web.app import make_app, make_context
from hmi.web.render import Renderer
from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    CommandName,
    Noted,
    Outcome,
    Published,
)
from station.channel.messages import ChannelError
from station.channel.panel_run import GetPanelState, PanelState
from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.twin.console import ask as ask_twin
from tests.chromium import ARGUMENTS, follow, next_document
from tests.eventually import PATIENCE_S, eventually
from tests.hosts import fresh_host
from tests.ports import free_ports
from tests.quick_recipes import NUMBERS, quick_recipes
from tests.slower_mode import SLOWER_MODE

ADMIN, ADMIN_PIN = "admin", "482915"
OPERATOR, OPERATOR_PIN = "Ana", "7391"
KEEPER = """
import os, subprocess, sys, time
if os.fork():
    os._exit(0)
tests, log, pid_file, *command = sys.argv[1:]
process = subprocess.Popen(command, stdout=open(log, "wb"), stderr=subprocess.STDOUT, start_new_session=True)
with open(pid_file + ".new", "w") as file:
    file.write(str(process.pid))
os.replace(pid_file + ".new", pid_file)
while process.poll() is None:
    if not os.path.exists(f"/proc/{tests}"):
        process.terminate()
    time.sleep(0.2)
"""
"""Keeps a program for these tests and ends it with them, apart from their own processes: what it starts anew while a
test goes on is none of that test's."""


def run_apart(work: Coroutine[Any, Any, Any]) -> Any:
    """Run in a loop of its own, in a thread of its own: Playwright's own loop runs in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()


@dataclass
class Cell:
    """The running station, and what the line does with it."""

    configuration: Configuration
    console: int
    folder: Path
    file: Path
    supervisor: psutil.Process
    trigger_id: int = 0
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.configuration.hmi.port}"

    def twin(self, **request: Any) -> None:
        ask_twin("127.0.0.1", self.console, request, PATIENCE_S)

    def as_plc(self, *requests: tuple[Any, Any]) -> list[Any]:
        """Send requests to the station as the PLC interface does; return the replies."""
        return run_apart(self._send(line_endpoint(self.configuration.handshake, self.configuration.home), requests))

    def state(self) -> PanelState | None:
        endpoint = panel_endpoint(self.configuration.hmi, self.configuration.home)
        try:
            return run_apart(self._send(endpoint, [(GetPanelState(), PanelState)], 2.0))[0]
        except ChannelError:
            return None

    def until(self, what: Callable[[PanelState], Any]) -> PanelState:
        def look() -> PanelState | None:
            state = self.state()
            return state if state is not None and what(state) else None

        return eventually(look, of=what)

    def choose(self, kind: str) -> None:
        """A ready station with a recipe and its fruit; on a bench a person first confirms that the jaws are clear."""
        self.twin(do="remove")
        self.until(lambda state: not state.busy and (state.state in {"unknown", "held", "idle", "stopped"}))
        eventually(self._settled)
        orders = [(CommandName.RESET, 0), (CommandName.CHANGE_RECIPE, NUMBERS[kind])]
        for done in self.as_plc(*((Command(command=name, argument=n), CommandDone) for name, n in orders)):
            assert done.done, done.why
        self.twin(do="fruit", kind=kind, seed=1, bruised=False)
        self.until(lambda state: state.ready)

    def _settled(self) -> bool:
        """Return whether the PLC interface has seen each start of the service: it calls off what it did not trigger."""
        log = (self.folder / "station.log").read_text()
        return log.count("what was open is settled") > log.count("the process service ended")

    def begin(self) -> int:
        """Trigger, as often as it takes on a machine that has other work; gives the accepted inspection's number."""

        def trigger() -> int | None:
            self.until(lambda state: state.ready)
            self.trigger_id += 1
            return self.as_plc((Begin(trigger_id=self.trigger_id, encoder=7, lot="LOT 1"), BeginReply))[0].sequence

        return eventually(trigger)

    def end(self, sequence: int) -> Outcome:
        """Wait for an outcome, and take it as the PLC does."""
        outcome = self.as_plc((AwaitOutcome(sequence=sequence), Outcome))[0]
        self.as_plc((Published(outcome=outcome), Noted), (Acknowledged(sequence=sequence), Noted))
        return outcome

    def process(self, name: str) -> psutil.Process:
        """A process of the station."""

        def look() -> psutil.Process | None:
            for child in self.supervisor.children(recursive=True):
                with contextlib.suppress(psutil.Error):
                    if f"-m station {name}" in " ".join(child.cmdline()):
                        return child
            return None

        return eventually(look)

    @staticmethod
    async def _send(endpoint: str, requests: Any, deadline_s: float = PATIENCE_S) -> list[Any]:
        async with ChannelClient(endpoint, "the station") as client:
            return [await client.request(request, reply, deadline_s=deadline_s) for request, reply in requests]


@contextlib.contextmanager
def started(command: list[str], log: Path, environment: dict[str, str]) -> Iterator[psutil.Process]:
    pid_file = log.with_suffix(".pid")
    keeper = [sys.executable, "-c", KEEPER, str(os.getpid()), str(log), str(pid_file), *command]
    subprocess.run(keeper, env=environment, check=True, timeout=PATIENCE_S)
    process = psutil.Process(int(eventually(lambda: pid_file.exists() and pid_file.read_text())))
    try:
        yield process
    finally:
        family = [process, *process.children(recursive=True)] if process.is_running() else []
        with contextlib.suppress(psutil.Error):
            process.terminate()
        _, left = psutil.wait_procs(family, 40)
        for each in left:
            each.kill()
        assert not left, f"had to be killed: {left}"


def is_logged(log: Path, words: str, process: psutil.Process) -> bool:
    assert process.is_running(), log.read_text()
    return words in log.read_text()


@pytest.fixture(scope="package")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """One station for all tests of this folder; each test leaves it ready, or makes it so."""
    folder = tmp_path_factory.mktemp("cell")
    modbus, metrics, hmi, camera, console = free_ports(5)
    host = fresh_host()
    values = {
        "home": str(folder / "home"),
        "recipes_folder": str(quick_recipes(folder / "recipes", settle_s=0.2)),
        "modbus": {"port": modbus},
        "metrics": {"port": metrics},
        "hmi": {"port": hmi, "cleaning_s": 5},
        "gripper": {
            "urcap": {"host": host},
            "modbus_rtu": {"host": host},
            "answer_timeout_s": 2.0,
            "move_margin_s": 8.0,
        },
        "camera": {"oldest_s": 3.0, "twin": {"port": camera}},
        "handshake": {"station_lost_after_s": 30.0},
        "records": {"free_reserve_mb": 1},
        "service": {
            "bench": True,
            "retry_longest_s": 0.5,
            "patience": 10.0,
            "inspection_deadline_s": None,
            "uncalibrated": "allow",
        },
    }
    file = folder / "station.yaml"
    file.write_text(json.dumps(values))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    station = [sys.executable, "-m", "station"]
    twin_log, log = folder / "twin.log", folder / "station.log"
    with contextlib.ExitStack() as stack:
        twin = [*station, "twin", "--config", str(file), "--bench", "--console", str(console)]
        twin_process = stack.enter_context(started(twin, twin_log, environment))
        eventually(lambda: is_logged(twin_log, "running", twin_process))
        supervisor = stack.enter_context(started([*station, "run", "--config", str(file)], log, environment))
        eventually(lambda: is_logged(log, "running", supervisor), 2 * PATIENCE_S)
        configuration = load_configuration(file, {})
        made = Cell(configuration, console, folder, file, supervisor, environment=environment)
        made.twin(**SLOWER_MODE)
        yield made


@pytest.fixture(name="eventually")
def polled() -> Callable[..., Any]:
    """Polls until something is so."""
    return eventually


@pytest.fixture
def ready(cell: Cell) -> Cell:
    """The station, ready with blueberries."""
    cell.choose("blueberry")
    return cell


def connected(playwright: Playwright, address: str) -> Browser:
    """Connect to a Chromium; a connection that hung is made anew once."""
    with contextlib.suppress(BrowserTimeout):
        return playwright.chromium.connect_over_cdp(address)
    return playwright.chromium.connect_over_cdp(address)


@pytest.fixture(scope="module")
def browser(cell: Cell, tmp_path_factory: pytest.TempPathFactory, chromium: str) -> Iterator[Browser]:
    """One headless Chromium for the tests of a file: no other file's tests may meet Playwright's running loop."""
    folder, port = tmp_path_factory.mktemp("browser"), free_ports(1)[0]
    profile, log = f"--user-data-dir={folder / 'profile'}", folder / "chromium.log"
    # A connection made while the first window is still being opened once waited 30 s for it in vain.
    command = [chromium, *ARGUMENTS, "--no-startup-window", profile, f"--remote-debugging-port={port}"]
    with started(command, log, cell.environment) as process:
        eventually(lambda: is_logged(log, "DevTools listening", process))
        with sync_playwright() as playwright:
            browser = connected(playwright, f"http://127.0.0.1:{port}")
            yield browser
            browser.close()


@dataclass
class Panel:
    """One browser's page, and a person's hand on it."""

    context: BrowserContext
    page: Page
    address: str
    complaints: list[str]

    def open(self, path: str) -> None:
        """Go to a page; on a machine with other work the pages' process may just be started again."""

        def gone() -> bool:
            try:
                self.page.goto(self.address + path)
            except BrowserError as error:
                if not any(why in str(error) for why in ("ERR_CONNECTION_REFUSED", "by another navigation")):
                    raise
                return False
            return True

        eventually(gone)

    def order(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=re.compile(name)).first.click()

    def hold(self, selector: str) -> None:
        """Hold a button until it has taken."""
        button = self.page.locator(selector).first
        button.hover()
        with next_document(self.page):
            self.page.mouse.down()
        self.page.mouse.up()

    def log_in(self, name: str, pin: str, *, by_pad: bool = False) -> None:
        """As the person does, by the number pad or by a keyboard."""
        self.open("/people")
        self.page.locator(f"input[name=name][value='{name}']").check(force=True)
        if by_pad:
            for digit in pin:
                self.page.locator(f"[data-digit='{digit}']").click()
        else:
            self.page.fill("#pin", pin)
        follow(self.page.locator("form[action='/people/log-in'] .button.main"))

    def overflow(self) -> int:
        """By how many pixels the page is wider than the screen."""
        return self.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")

    def text(self, selector: str = "body") -> str:
        return self.page.inner_text(selector)

    def until(self, selector: str, words: str) -> None:
        """Wait until a part of the page shows a text."""
        part = self.page.locator(selector)
        try:
            part.filter(has_text=re.compile(words)).first.wait_for(timeout=1000 * PATIENCE_S)
        except BrowserTimeout as late:
            raise AssertionError(f"{self.page.url} does not show {words!r} but {part.all_inner_texts()}") from late


@pytest.fixture
def panel(browser: Browser, cell: Cell) -> Iterator[Callable[..., Panel]]:
    """Opens a browser of its own; a complaint in its console fails the test, unless that was expected."""
    opened: list[Panel] = []

    def begin(address: str = "", width: int = 1280, height: int = 800, locale: str = "en-GB", **more: Any) -> Panel:
        context = browser.new_context(viewport={"width": width, "height": height}, locale=locale, **more)
        context.set_default_timeout(1000 * PATIENCE_S)
        page = context.new_page()
        complaints: list[str] = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda message: complaints.append(message.text) if "Content Security Policy" in message.text else None,
        )
        opened.append(Panel(context, page, address or cell.address, complaints))
        return opened[-1]

    yield begin
    complaints = [complaint for each in opened for complaint in each.complaints]
    for each in opened:
        each.context.close()
    assert complaints == []


@pytest.fixture
def people(cell: Cell, panel: Callable[..., Panel]) -> Cell:
    """The station with an administrator and an operator."""
    file = cell.configuration.home / "hmi" / "people.json"
    known = json.loads(file.read_text())["people"] if file.exists() else {}
    if ADMIN not in known:
        first = panel()
        first.open("/people")
        first.page.fill("input[name=name]", ADMIN)
        first.page.fill("#pin", ADMIN_PIN)
        first.page.fill("#again", ADMIN_PIN)
        follow(first.page.locator("form[action='/people/begin'] .button.main"))
        known = {ADMIN: {}}
    if OPERATOR not in known:
        admin = panel()
        admin.log_in(ADMIN, ADMIN_PIN)
        admin.open("/people")
        admin.page.locator("summary").last.click()
        form = admin.page.locator("form[action='/people/put']")
        form.locator("input[name=name]").fill(OPERATOR)
        form.locator("select[name=role]").select_option("operator")
        form.locator("#their").fill(OPERATOR_PIN)
        follow(form.locator(".button.main"))
    return cell


@pytest.fixture
def operator(people: Cell, panel: Callable[..., Panel]) -> Panel:
    """A browser at which the operator is logged in."""
    logged_in = panel()
    logged_in.log_in(OPERATOR, OPERATOR_PIN)
    return logged_in


Answer = tuple[int, dict[str, str], bytes]


@dataclass
class Pages:
    """The web application without a server, called request by request."""

    app: Any
    context: Any
    cookies: dict[str, str] = field(default_factory=dict)
    client_address: str = "127.0.0.1"
    unread: int = 0
    """Pieces of the last request that were not read."""

    def __call__(
        self, method: str, path: str, body: bytes = b"", *, headers: dict[str, str] | None = None, chunks: int = 1
    ) -> Answer:
        given = {"host": "127.0.0.1:8080", "content-length": str(len(body))} | (headers or {})
        if self.cookies:
            given["cookie"] = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        scope = {
            "type": "http",
            "http_version": "1.1",
            "method": method,
            "scheme": "http",
            "path": path.partition("?")[0],
            "raw_path": path.partition("?")[0].encode(),
            "query_string": path.partition("?")[2].encode(),
            "root_path": "",
            "headers": [(name.encode(), value.encode()) for name, value in given.items() if value],
            "client": (self.client_address, 50_000),
            "server": ("127.0.0.1", 8080),
        }
        return run_apart(self._send(scope, body, chunks))

    async def _send(self, scope: dict[str, Any], body: bytes, chunks: int) -> Answer:
        size = max(1, -(-len(body) // chunks))
        parts = [body[at : at + size] for at in range(0, len(body), size)] or [b""]
        coming = [
            {"type": "http.request", "body": part, "more_body": number < len(parts) - 1}
            for number, part in enumerate(parts)
        ]
        sent: list[dict[str, Any]] = []

        async def receive() -> dict[str, Any]:
            return coming.pop(0) if coming else {"type": "http.disconnect"}

        async def send(message: dict[str, Any]) -> None:
            sent.append(message)

        with contextlib.suppress(RuntimeError):  # which the framework raises on from its own error page
            await self.app(scope, receive, send)
        self.unread = len(coming)
        headers = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
        if "set-cookie" in headers:
            name, _, value = headers["set-cookie"].partition(";")[0].partition("=")
            self.cookies[name] = value
        return sent[0]["status"], headers, b"".join(message.get("body", b"") for message in sent[1:])

    def token(self, path: str = "/people") -> str:
        """A fresh one, from a page."""
        page = self("GET", path)[2].decode()
        found = re.search(r'data-token="([^"]+)"', page)
        assert found is not None, page
        return found[1]

    def post(self, path: str, **fields: str) -> Answer:
        """Send a form as one of our own pages does."""
        headers = {
            "content-type": "application/x-www-form-urlencoded",
            "origin": "http://127.0.0.1:8080",
            "sec-fetch-site": "same-origin",
        }
        return self("POST", path, urlencode(fields).encode(), headers=headers)


_FIRST: list[tuple[Any, Renderer]] = []
"""The first test's routes and templates, for all tests of a process: to resolve them takes as long as many requests."""


@pytest.fixture
def pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Pages:
    """The web application over a station that is not there."""
    if _FIRST:
        monkeypatch.setattr("hmi.web.app.Renderer", lambda _assets: _FIRST[0][1])
    site = load_configuration(None, {"STATION_HOME": str(tmp_path)})
    context = make_context(site, tmp_path / "station.yaml", "")
    app = make_app(context)
    if not _FIRST:
        _FIRST.append((app._app, context.renderer))
    app._app = _FIRST[0][0]
    app._app.state.hmi = context
    return Pages(app, context)


@pytest.fixture
def free_hmi(unused_port: int, tmp_path: Path) -> Iterator[Callable[..., str]]:
    """Starts one more process of the pages of the same station, with other settings; gives its address."""
    with contextlib.ExitStack() as stack:

        def begin(cell: Cell, **variables: str) -> str:
            log = tmp_path / "hmi.log"
            command = [sys.executable, "-m", "station", "hmi", "--config", str(cell.file)]
            environment = {**cell.environment, "STATION_HMI_PORT": str(unused_port), **variables}
            process = stack.enter_context(started(command, log, environment))
            eventually(lambda: is_logged(log, "the pages are served", process))
            scheme = "https" if "STATION_HMI_TLS_ENABLED" in variables else "http"
            return f"{scheme}://127.0.0.1:{unused_port}"

        yield begin


@pytest.fixture
def certificate(tmp_path: Path) -> dict[str, str]:
    """Signed by itself, for 127.0.0.1; gives the settings that name it."""
    key = ec.generate_private_key(ec.SECP256R1())
    name, now = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "station")]), datetime.now(UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(IPv4Address("127.0.0.1"))]), critical=False)
        .sign(key, hashes.SHA256())
    )
    pem, plain = serialization.Encoding.PEM, serialization.NoEncryption()
    (tmp_path / "station.crt").write_bytes(made.public_bytes(pem))
    (tmp_path / "station.key").write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain))
    return {
        "STATION_HMI_TLS_ENABLED": "true",
        "STATION_HMI_TLS_CERTIFICATE": str(tmp_path / "station.crt"),
        "STATION_HMI_TLS_KEY": str(tmp_path / "station.key"),
    }
