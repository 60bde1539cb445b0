"""Chromium under test: its arguments, and a click that waits for its page."""

from playwright.sync_api import Locator

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


def follow(lead: Locator) -> None:
    """Click what leads to another page, and wait until that is loaded, which Playwright's own click does not."""
    with lead.page.expect_navigation():
        lead.click()
