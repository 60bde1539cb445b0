"""The pages as pictures for the documents."""

import io
import re
from pathlib import Path

import psutil
from PIL import Image
from playwright.sync_api import Browser, Page

from station.twin.console import ask

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "images"
PIN = "482915"
FAIL_WITHIN_S = 300
SIZES = {"": (1280, 800), "-phone": (390, 844)}
PAGES = {
    "run": "/",
    "change": "/change",
    "recipes": "/recipes",
    "recipe": "/recipes/strawberry",
    "recipe-edit": "/recipes/strawberry/edit",
    "history": "/history",
    "audit": "/history/audit",
    "maintenance": "/maintenance",
    "maintenance-hand": "/maintenance/hand",
    "maintenance-image": "/maintenance/image",
    "maintenance-sensor": "/maintenance/sensor",
    "maintenance-registers": "/maintenance/registers",
    "people": "/people",
}


def draw(address: str, process: psutil.Process, browser: Browser, console: int) -> None:
    """Every page as a picture, at the panel's size and a phone's.

    Args:
        address: of the pages, at their first start.
        process: the pages'.
        browser: which draws them.
        console: the twin's, for an alarm.
    """
    page = browser.new_context().new_page()
    page.goto(f"{address}/people")
    save_in_all_sizes(page, "first-start")
    page.fill("#pin", PIN)
    page.fill("#again", PIN)
    with page.expect_navigation():
        page.locator("form[action='/people/begin'] .main").click()
    with page.expect_navigation():
        page.locator(".who form button").click()
    page.goto(f"{address}/people")
    save_in_all_sizes(page, "log-in")
    page.locator("input[name=name]").first.check(force=True)
    page.fill("#pin", PIN)
    with page.expect_navigation():
        page.locator(".log-in .main").click()
    page.goto(address)
    failed = page.locator(".tile-fail").first  # of which every image is stored
    failed.wait_for(timeout=1000 * FAIL_WITHIN_S)
    inspection = (failed.get_attribute("href") or "").replace("/fruit/", "/history/")
    page.goto(address + inspection)
    step = page.locator(".steps a").last.get_attribute("href") or ""
    for name, path in {**PAGES, "inspection": inspection, "step": step}.items():
        page.goto(address + path)
        save_in_all_sizes(page, name)
    alarm_drawn(page, address, console)
    page.goto(f"{address}/panel")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto(f"{address}/history")
    page.locator("summary").first.click()
    page.locator("[role=search] [name=lot]").click()
    settled(page)
    keep(page, "keyboard")
    page.context.clear_cookies(name=re.compile("^station_panel"))
    page.goto(f"{address}/change")
    page.locator(".fruit-tile:not(.active)").first.click()
    save_in_all_sizes(page, "confirm")
    page.goto(address)
    settled(page)
    process.suspend()  # the last, as the station raises an alarm of it
    page.locator("body.stale").wait_for()
    page.wait_for_timeout(2500)
    save_in_all_sizes(page, "stale")
    process.resume()
    page.locator("body:not(.stale)").wait_for()
    page.context.close()


def alarm_drawn(page: Page, address: str, console: int) -> None:
    """An alarm, raised by the gripper's cable, and taken back."""
    fault = {"device": "gripper", "fault": "off"}
    ask("127.0.0.1", console, {"do": "set", **fault})
    page.goto(f"{address}/alarms")
    page.locator("#alarm-gripper_link_lost").wait_for(timeout=1000 * FAIL_WITHIN_S)
    save_in_all_sizes(page, "alarms")
    page.locator("#alarm-gripper_link_lost").click()
    save_in_all_sizes(page, "alarm")
    with page.expect_navigation():
        page.get_by_role("button", name="Acknowledge").first.click()
    ask("127.0.0.1", console, {"do": "clear", **fault})
    page.locator(".alarm").first.wait_for(state="detached", timeout=1000 * FAIL_WITHIN_S)


def save_in_all_sizes(page: Page, name: str) -> None:
    """Save the page at the panel's size and at a phone's."""
    for size, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        settled(page)
        keep(page, f"{name}{size}")


def keep(page: Page, name: str) -> None:
    """A picture of what is seen without scrolling, in few colours: the pages are grey."""
    drawn = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    drawn.quantize(64, dither=Image.Dither.NONE).save(PICTURES / f"hmi-{name}.png", optimize=True)


def settled(page: Page) -> None:
    """Until the pictures are there."""
    page.wait_for_load_state("load")
    page.wait_for_timeout(1200)
