"""Chromium under test: its arguments, a finger, and a wait for the page that a click leads to."""

import contextlib
import time
from collections.abc import Callable, Iterator

from playwright.sync_api import Error, Locator, Page

_PATIENCE_S = 30.0
_LOOK_AGAIN_MS = 10
_STAYS_MS = 400

_WITHOUT = (
    # They keep a process ready for the address bar's suggestions: half a second of a core for each window.
    "WebUIOmniboxPopup", "WebUIOmniboxAimPopup", "WebUIOmniboxFullPopup",
    # It begins a process for the next page before there is one.
    "SpareRendererForSitePerProcess",
    # Playwright switches these off too, by an argument that this one takes the place of.
    "AimEnabled", "HttpsUpgrades", "PaintHolding", "OptimizationHints", "MediaRouter",
)  # fmt: skip
ARGUMENTS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-auto-reload",  # of a page that was refused, which would interrupt the next try to open it
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    f"--disable-features={','.join(_WITHOUT)}",
)
"""Headless, in a container, without what a person's browser does in its background."""


_LONG = """() => {
  const any = (...names) => new Promise((done) => {
    names.forEach((name) => addEventListener(name, () => done(), true));
  });
  window.longPress = any("contextmenu", "dragstart");
  window.lifted = any("pointerup", "pointercancel");
}"""
"""Waits for what a long press does in Chromium, which is to open a menu or to drag a link, and for its end."""


_SETTLED = "performance.now() - performance.getEntriesByType('navigation')[0].domContentLoadedEventEnd > 400"
"""By SETTLE_MS of the pages' touch.js, which begins before the document's content is loaded."""


@contextlib.contextmanager
def next_document(page: Page) -> Iterator[None]:
    """Wait, at the end of the block, until what was done in it has brought another document, and that is loaded.

    Not by `expect_navigation`: a page whose state has changed loads itself anew, and where the click calls that off,
    Playwright takes it for the click's own navigation, which failed.
    """
    before, _ = _until(page, lambda _origin, _state: True)
    yield
    _until(page, lambda origin, state: origin != before and state == "complete")


def follow(lead: Locator) -> None:
    """Click what leads to another page, and wait until that is loaded, which Playwright's own click does not."""
    with next_document(lead.page):
        lead.click()


def settle(page: Page) -> None:
    """Wait until a page takes a touch: one right after it is shown is the second contact of one for the page before."""
    while not page.evaluate(_SETTLED):
        page.wait_for_timeout(_LOOK_AGAIN_MS)


class Finger:
    """A finger on a page, whose click is an event after its lifting. However long it stays, that is no long press."""

    def __init__(self, page: Page) -> None:
        self._session = page.context.new_cdp_session(page)

    def down(self, x: float, y: float) -> None:
        self._send("touchStart", {"x": x, "y": y})

    def move(self, x: float, y: float) -> None:
        self._send("touchMove", {"x": x, "y": y})

    def up(self) -> None:
        self._send("touchEnd")

    def _send(self, kind: str, *points: dict[str, float]) -> None:
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(points)})


def tap(lead: Locator) -> None:
    """Press as a finger does."""
    finger = Finger(lead.page)
    finger.down(*_middle(lead))
    finger.up()


def press_long(lead: Locator) -> None:
    """Press as a slow finger does: Chromium takes it for a long press, and it stays on."""

    def send(kind: str) -> None:
        session.send("Input.emulateTouchFromMouseEvent", {"type": kind, "x": x, "y": y, "button": "left"})

    x, y = _middle(lead)
    lead.page.evaluate(_LONG)
    session = lead.page.context.new_cdp_session(lead.page)
    session.send("Emulation.setEmitTouchEventsForMouse", {"enabled": True, "configuration": "desktop"})
    send("mousePressed")
    lead.page.evaluate("window.longPress")
    lead.page.wait_for_timeout(_STAYS_MS)
    send("mouseReleased")
    with contextlib.suppress(Error):  # the document is being replaced
        lead.page.evaluate("window.lifted")
    session.detach()


def _middle(lead: Locator) -> tuple[int, int]:
    box = lead.bounding_box()
    assert box is not None
    return round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)


def _until(page: Page, reached: Callable[[float, str], bool]) -> tuple[float, str]:
    """Wait for a document by the time of its origin and its state, and return these."""
    deadline_s = time.monotonic() + _PATIENCE_S
    while True:
        with contextlib.suppress(Error):  # the document is being replaced
            origin, state = page.evaluate("[performance.timeOrigin, document.readyState]")
            if reached(origin, state):
                return origin, state
        assert time.monotonic() < deadline_s, f"no other page came after {page.url}"
        page.wait_for_timeout(_LOOK_AGAIN_MS)
