"""The page Set-up in a real browser: from a station without devices to its first fruit, live, by keyboard."""

import contextlib
import json
import signal
import socket
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from hmi.web.user_store import UserStore
from station.records.database import FILE_NAME
from tests.chromium import follow
from tests.hmi_pages.conftest import PATIENCE_S, PATIENT_HANDSHAKE, PIN, Person, quick_recipes, start_program
from tests.hosts import fresh_host
from tests.ports import free_port

pytestmark = pytest.mark.timeout(600)

TARGET_PX = 15 / 25.4 * (1280**2 + 800**2) ** 0.5 / 10.1
SMALLEST_PX = 15
"""Of the pages of Maintenance, read from an arm's length."""


class Fresh:
    """A fresh installation; its devices, and what a person does at its command line."""

    def __init__(self, folder: Path) -> None:
        host, self.port = fresh_host(), free_port()
        self.file, self.folder, self.console = folder / "station.yaml", folder, ""
        values = {
            "home": str(folder / "home"),
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
            "hmi": {"port": self.port, "idle_s": 3600.0},
            "records": {"free_reserve_mb": 1},
            "service": {"bench": True, "retry_longest_s": 0.5, "patience": 10.0, "inspection_deadline_s": None},
        }
        self.file.write_text(json.dumps(values))
        UserStore(folder / "home" / "hmi").begin("Ada", PIN)
        self.processes: list[subprocess.Popen[str]] = []

    def begin(self, *command: str, ready: str) -> None:
        """Start a part of the station, and wait until it reports that it is ready."""

        def is_ready(line: str) -> bool:
            if line.startswith("console"):
                self.console = line.split(":")[1].strip()
            return ready in line

        log = self.folder / f"{command[0]}.log"
        self.processes.append(start_program([*command, "--config", str(self.file)], is_ready, log))

    def serve(self, *command: str) -> None:
        """Start a part that writes nothing to its standard output."""
        with (self.folder / f"{command[0]}.log").open("w") as log:
            whole = [sys.executable, "-m", "station", *command, "--config", str(self.file)]
            self.processes.append(subprocess.Popen(whole, stdout=log, stderr=log, text=True))

    def run(self, *command: str) -> None:
        """Run a command to its end."""
        whole = [sys.executable, "-m", "station", *command, "--config", str(self.file)]
        done = subprocess.run(whole, capture_output=True, text=True, check=False, timeout=2 * PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr

    def first_measured(self) -> int:
        """The number of the first fruit with an area, as the records have it."""
        with contextlib.closing(sqlite3.connect(self.folder / "home" / "records" / FILE_NAME)) as records:
            query = "SELECT min(sequence) FROM inspections WHERE area_mm2 IS NOT NULL"
            return int(records.execute(query).fetchone()[0])

    def end(self) -> None:
        for process in reversed(self.processes):
            process.send_signal(signal.SIGTERM)
        for process in reversed(self.processes):
            process.communicate(timeout=40)


@pytest.fixture
def fresh(tmp_path: Path, eventually: Callable[..., Any]) -> Iterator[Fresh]:
    """The station and its pages; no device answers yet."""
    made = Fresh(tmp_path)
    try:
        made.begin("service", ready="running")
        made.serve("hmi")
        made.serve("plc", "run")
        yield made
    finally:
        made.end()


@pytest.fixture
def admin(fresh: Fresh, browser: Browser, eventually: Callable[..., Any]) -> Iterator[Page]:
    """The administrator's browser."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, locale="en")
    context.set_default_timeout(1000 * PATIENCE_S)
    person = Person(context, context.new_page(), f"http://127.0.0.1:{fresh.port}")
    eventually(lambda: _served(fresh.port))
    person.log_in("Ada")
    yield person.go("/")
    context.close()


def _served(port: int) -> bool:
    with contextlib.suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port), 5):
        return True
    return False


def state_of(page: Page, step: str, words: str) -> None:
    expect(page.locator(f"[data-step={step}] .setup-state")).to_have_text(words)


def test_from_a_fresh_installation_to_the_first_fruit(fresh: Fresh, admin: Page) -> None:
    page = admin
    expect(page.get_by_text("The set-up of this station is not finished.")).to_be_visible()
    page.get_by_role("link", name="Continue the set-up").press("Enter")
    state_of(page, "gripper", "Next")
    state_of(page, "camera", "Can be done now")
    state_of(page, "calibration", "Waits for: Gripper, Camera")
    expect(page.locator("[data-step=gripper] .setup-says")).to_contain_text("no connection to URCap")
    assert page.locator("[data-step=arm]").count() == 0, "a bench has no arm"
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    sizes = "all => all.map((each) => parseFloat(getComputedStyle(each).fontSize))"
    assert min(page.locator("main p, main h2, main code, main .button").evaluate_all(sizes)) >= SMALLEST_PX
    heights = "all => all.map((each) => each.getBoundingClientRect().height)"
    assert min(page.locator(".setup .button").evaluate_all(heights)) >= TARGET_PX - 1

    address = page.url
    page.evaluate("document.body.dataset.same = 'yes'")
    page.locator("#setup-plc-1").focus()
    fresh.begin("twin", "--bench", "--fruit", "strawberry", "--console", "0", ready="running")
    state_of(page, "camera", "Done")
    expect(page.locator("[data-step=gripper] .setup-says")).to_contain_text("jaws")
    assert page.evaluate("document.activeElement.id") == "setup-plc-1", "the focus stays as the page follows"
    assert page.evaluate("document.body.dataset.same") == "yes", "all this without a reload"
    follow(page.locator("[data-step=gripper]").get_by_role("link", name="Run"))
    follow(page.get_by_role("button", name="Start"))  # on a bench a person confirms that nothing is between the jaws
    page.goto(address)
    state_of(page, "gripper", "Done")
    state_of(page, "plc", "Next")
    expect(page.locator("[data-step=zero]")).to_contain_text("Width now: 53.0 mm")
    fresh.run("calibrate", "simulated")
    for step in ("calibration", "reference", "zero"):
        state_of(page, step, "Done")
    state_of(page, "first", "Waits for: PLC, Recipe")

    follow(page.locator("[data-step=recipe]").get_by_role("link", name="Change fruit"))
    follow(page.get_by_role("link", name="Strawberry"))
    follow(page.get_by_role("button", name="Change"))
    page.goto(address)
    state_of(page, "recipe", "Done")
    line = ["line", "--fruit", "strawberry", "--damaged", "0", "--twin", fresh.console, "--every", "2"]
    fresh.serve(*line)
    state_of(page, "plc", "Done")
    state_of(page, "first", "Done")
    expect(page.get_by_text("The set-up is complete.")).to_be_visible()
    follow(page.locator("#setup-first-fruit"))
    expect(page.get_by_role("heading", name=f"Fruit {fresh.first_measured()}", exact=True)).to_be_visible()
    page.goto(page.url.split("/history")[0])
    expect(page.get_by_text("The set-up of this station is not finished.")).to_have_count(0)
