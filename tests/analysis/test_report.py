"""The report, read by a real browser from the disk with no network."""

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By

ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--proxy-server=127.0.0.1:9",
)


@pytest.fixture
def browser(chromium, tmp_path):
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (*ARGUMENTS, f"--user-data-dir={tmp_path / 'profile'}"):
        options.add_argument(argument)
    driver = webdriver.Chrome(options, webdriver.ChromeService("/usr/bin/chromedriver"))
    yield driver
    driver.quit()


def test_the_report_shows_every_picture_and_the_curve_without_a_network(press, analyze, browser, tmp_path):
    out = tmp_path / "out"
    done = analyze(
        "--reference", press.reference, "--method", "paper", "--stages", "--widths", press.widths, "--out", out,
        press.folder,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    browser.get((out / "report.html").as_uri())
    pictures = browser.find_elements(By.CSS_SELECTOR, "img")
    assert len(pictures) == 7
    assert all(picture.get_property("naturalWidth") > 0 for picture in pictures)
    assert browser.find_element(By.CSS_SELECTOR, ".curve svg").size["height"] > 100
    sources = browser.execute_script("return performance.getEntriesByType('resource').map(entry => entry.name)")
    assert not [source for source in sources if source.startswith("http")]


def test_names_from_outside_are_shown_as_text(press, analyze, browser, tmp_path):
    name = "<img src=x onerror=document.title='owned'>.png"
    (press.folder / "frame_9.png").rename(press.folder / name)
    out = tmp_path / "out"
    done = analyze("--reference", press.reference, "--method", "paper", "--out", out, press.folder / name)
    assert done.returncode == 0, done.stderr
    browser.get((out / "report.html").as_uri())
    assert browser.find_element(By.CSS_SELECTOR, ".tile b").text == name
    assert browser.title == "Contact areas of 1 images"
