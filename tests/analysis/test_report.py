"""The report, read by a real browser from the disk with no network."""

from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from playwright.sync_api import sync_playwright

from tests.chromium import ARGUMENTS


@pytest.fixture
def page(chromium):
    """A page of a headless browser, which ends with the test."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=[*ARGUMENTS, "--proxy-server=127.0.0.1:9"])
        yield browser.new_page()
        browser.close()


def test_the_report_shows_every_picture_and_the_curve_without_a_network(press, analyze, page, tmp_path):
    out = tmp_path / "out"
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--stages", "--widths", press.widths, "--out", out,
        press.folder,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    page.goto((out / "report.html").as_uri())
    widths = page.eval_on_selector_all("img", "pictures => pictures.map(picture => picture.naturalWidth)")
    assert len(widths) == 7
    assert all(width > 0 for width in widths)
    box = page.locator(".plot svg").first.bounding_box()
    assert box is not None
    assert box["height"] > 100
    text = page.locator(".plot svg text").first
    assert text.evaluate("text => getComputedStyle(text).stroke") == "none"
    sources = page.evaluate("performance.getEntriesByType('resource').map(entry => entry.name)")
    assert not [source for source in sources if source.startswith("http")]


def test_names_from_outside_are_shown_as_text(press, analyze, page, tmp_path):
    name = "<img src=x onerror=document.title='owned'>#1 100%.png"
    (press.folder / "frame_9.png").rename(press.folder / name)
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, press.folder / name)
    assert done.returncode == 0, done.stderr
    page.goto((out / "report.html").as_uri())
    assert page.inner_text(".tile b") == name
    mask = page.eval_on_selector(".tile a", "link => link.href")
    assert Path(unquote(urlsplit(mask).path)).is_file()
    assert page.title() == "Contact areas of 1 images"
