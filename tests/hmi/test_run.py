"""The run page in a real browser: the last fruit, and what stops."""

from datetime import UTC, datetime, timedelta

import pytest


@pytest.mark.timeout(240)
def test_a_fruit_is_shown_with_its_curve_and_its_picture(ready, panel, eventually):
    viewer = panel(locale="de-DE")
    viewer.open("/")
    sequence = ready.begin()
    outcome = ready.end(sequence)
    viewer.until(".run-fruit .facts", f"Nummer\\s*{sequence}\\b")
    word = {"PASS": "i. O.", "FAIL": "n. i. O.", "NO_RESULT": "Kein Ergebnis"}[outcome.outcome]
    assert word in viewer.text(".run-fruit .outcome")
    if outcome.area_mm2 is not None:
        assert f"{outcome.area_mm2:.1f}".replace(".", ",") in viewer.text(".run-fruit .facts")
    picture = viewer.page.locator(".fruit-picture")
    eventually(lambda: picture.evaluate("picture => picture.naturalWidth") == 480)
    drawn = viewer.context.request.get(viewer.address + picture.get_attribute("src"))
    assert "<polygon" in drawn.text()
    assert drawn.headers["cache-control"].startswith("private, max-age=")
    viewer.page.locator(".tile").first.click()
    viewer.until("h1", f"Frucht {sequence}")
    assert viewer.page.locator(".fruit-curve circle").count() > 1


@pytest.mark.timeout(240)
def test_what_stops_has_to_be_held_and_works_by_keyboard(ready, operator, eventually):
    operator.open("/")
    stop = operator.page.get_by_role("button", name="Stop")
    with operator.page.expect_navigation():
        stop.focus()
        operator.page.keyboard.down("Enter")
    operator.page.keyboard.up("Enter")
    ready.until(lambda state: state.state == "stopped" and state.stopping)
    operator.until(".run-activity", "Stopped")
    operator.page.get_by_role("button", name="Start").click()
    ready.until(lambda state: state.ready)
    operator.until(".run-activity", "Ready")
    # A touch that is too short, by the page's own clock: on a busy machine the browser's hand may be slow.
    clock, mouse = operator.page.clock, operator.page.mouse
    clock.install()
    operator.open("/")
    stop.hover()
    clock.pause_at(datetime.now(UTC) + timedelta(minutes=1))
    eventually(lambda: not operator.page.evaluate("document.body.classList.contains('stale')"))
    mouse.down()
    clock.run_for(900)
    assert operator.page.evaluate("document.querySelectorAll('.button.holding').length") == 1
    mouse.up()
    clock.run_for(2000)
    assert operator.page.evaluate("document.querySelectorAll('form[data-sent]').length") == 0
    assert ready.until(lambda _: True).ready, "a touch alone stops nothing"
