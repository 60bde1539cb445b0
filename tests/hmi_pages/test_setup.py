"""The page Set-up in a real browser, with a station's state of our own: sizes, languages, keyboard, live."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, Route, expect

from hmi.web.app import make_app, make_context
from hmi.web.roles import Role
from hmi.web.translation import Locale
from station.channel.panel_run import PanelState
from station.settings.configuration import load_configuration
from station.settings.hmi import LANGUAGES, Language
from tests.hmi.conftest import Pages
from tests.hmi.test_security import log_in
from tests.hmi.test_setup import DONE_SETUP, PATH, STRAWBERRY, state
from tests.hmi_pages.conftest import PATIENCE_S

TARGET_PX = 15 / 25.4 * (1280**2 + 800**2) ** 0.5 / 10.1
LEAST_PX = 15
"""The size of the smallest text of Maintenance, which is read at the panel."""
SIZES = ((1920, 1080), (1280, 800), (390, 844))
FOUND = state(fault=None)
COMPLETE = state(DONE_SETUP, fault=None, recipe=STRAWBERRY, plc_connected=True, plc_alive=True)

Open = Callable[..., Page]


class Station:
    """The pages, with the state that a test sets."""

    def __init__(self, folder: Path) -> None:
        context = make_context(load_configuration(None, {"STATION_HOME": str(folder)}), None, "")
        self.pages, self.live, self.boot = Pages(make_app(context), context), context.live, context.boot
        log_in(self.pages)
        self.now = state()

    @property
    def now(self) -> PanelState:
        """The station's state."""
        return self.pages.context.gateway.state

    @now.setter
    def now(self, now: PanelState) -> None:
        self.pages.context.gateway.state = now

    def answer(self, route: Route, language: Language) -> None:
        """Answer a browser's request; the stream has one event, and is requested again."""
        self.pages.context.gateway.heard_s = time.monotonic()
        path = "/" + route.request.url.split("/", 3)[3]
        if not path.startswith("/live"):
            status, headers, body = self.pages("GET", path, headers={"accept-language": language})
            route.fulfill(status=status, headers=headers, body=body)
            return
        part = self.live.part("setup.steps", Locale(language), Role.ADMIN)
        event = {"age_ms": 0, "utc_ms": 1, "boot": self.boot, "caller": "admin|admin"}
        sent = json.dumps({**event, "parts": {"setup.steps": [part.digest, part.html]}})
        route.fulfill(content_type="text/event-stream", body=f"retry: 200\n\ndata: {sent}\n\n")


@pytest.fixture
def station(tmp_path: Path) -> Station:
    """A fresh station; nothing answers."""
    return Station(tmp_path)


@pytest.fixture
def show(station: Station, browser: Browser) -> Iterator[Open]:
    """Opens the page in a browser of its own."""
    contexts = []

    def open_page(language: Language = "en", *, paused: bool = False) -> Page:
        contexts.append(context := browser.new_context(viewport={"width": 1280, "height": 800}, locale=language))
        context.set_default_timeout(1000 * PATIENCE_S)
        page = context.new_page()
        if paused:  # by its own clock the page is never stale, however busy this machine is
            page.clock.install(time=0)
            page.clock.pause_at(1)
        page.route("**/*", lambda route: station.answer(route, language))
        page.goto("http://127.0.0.1:8080" + PATH)
        return page

    yield open_page
    for context in contexts:
        context.close()


def state_of(page: Page, step: str, words: str) -> None:
    expect(page.locator(f"[data-step={step}] .setup-state")).to_have_text(words)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("language", LANGUAGES)
def test_it_fits_every_screen_is_accessible_and_has_room_for_a_finger(
    station: Station, show: Open, language: Language
) -> None:
    page = show(language)
    texts, buttons = page.locator(".setup h2, .setup p, .setup code, .setup .button"), page.locator(".setup .button")
    sizes = texts.evaluate_all("all => all.map((each) => parseFloat(getComputedStyle(each).fontSize))")
    assert min(sizes) >= LEAST_PX
    heights = buttons.evaluate_all("all => all.map((each) => each.getBoundingClientRect().height)")
    assert min(heights) >= TARGET_PX - 1
    found = Axe().run(page).response["violations"]
    assert [each["id"] for each in found if each["impact"] in {"serious", "critical"}] == []
    for now, last in ((state(), "blocked"), (COMPLETE, "next")):
        station.now = now
        page.locator(f".setup-{last}[data-step=first]").wait_for()
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth") <= width, width


@pytest.mark.timeout(120)
def test_it_follows_the_station_and_keeps_what_a_person_has_under_the_keyboard(station: Station, show: Open) -> None:
    page = show(paused=True)
    state_of(page, "gripper", "Next")
    state_of(page, "calibration", "Waits for: Gripper, Camera")
    page.evaluate("document.body.dataset.same = 'yes'")
    page.locator("#setup-plc-1").focus()
    station.now = FOUND
    state_of(page, "gripper", "Done")
    state_of(page, "plc", "Next")
    state_of(page, "calibration", "Can be done now")
    assert page.evaluate("document.activeElement.id") == "setup-plc-1"
    station.now = state()
    state_of(page, "gripper", "Next")
    assert page.evaluate("document.body.dataset.same") == "yes", "all this without a reload"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "PLC registers"
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Enter")
    page.wait_for_url("**/maintenance/configuration")
