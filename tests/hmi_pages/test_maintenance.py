"""The maintenance page in a real browser: jogging, live image, registers, verification."""

import json
import re
import zipfile
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from station.messages.readiness import STOPPED_BY_PERSON
from station.records.audit_report import read_audit
from station.records.database import reading
from tests.chromium import follow

pytestmark = pytest.mark.timeout(400)
KEY_PX = 15 / 25.4 * (1280**2 + 800**2) ** 0.5 / 10.1 - 1
"""15 mm on a 10.1" panel of 1280 x 800."""


def audited(site: Any, action: str) -> list[Any]:
    with reading(site.home / "records") as connection:
        return read_audit(connection, 50, action, "")[::-1]


def holding(page: Page, address: str) -> list[Any]:
    """Keeps a page's requests from being answered; returns the requests."""
    held: list[Any] = []

    def hold(route: Any) -> None:
        held.append(route)

    page.route(address, hold)
    return held


def start(person: Any, site: Any, eventually: Callable[..., Any]) -> None:
    """*Start*, which alone ends the stop of manual mode that was set at the panel."""
    assert site.state().why_not_ready == STOPPED_BY_PERSON()
    follow(person.go("/").get_by_role("button", name="Start", exact=True))
    eventually(site.ready)


def test_jogging_is_refused_out_of_manual_mode_and_done_in_it(
    orchard: Any, panel: Any, eventually: Callable[..., Any]
) -> None:
    person = panel("Max")
    page = person.go("/maintenance/hand")
    expect(page.get_by_text("set manual mode, 3, first")).to_be_visible()
    for name in ("Move", "Open", "+ 1 mm", "− 1 mm", "Set the illumination"):  # noqa: RUF001 (what is shown)
        expect(page.get_by_role("button", name=name, exact=True)).to_be_disabled()
    token = page.locator("input[name=csrf]").first.get_attribute("value") or ""
    form = {"csrf": token, "to": "width", "width_mm": "40"}
    refused = person.context.request.post(f"{person.address}/maintenance/jog", form=form)
    assert "The station is in mode 1" in refused.text()
    eventually(lambda: [row for row in audited(orchard, "maintenance.jog") if row.who == "Max"])
    page = person.go("/maintenance/hand")
    follow(page.get_by_role("button", name="Set manual mode"))
    expect(page.get_by_role("button", name="Back to production")).to_be_visible()
    expect(page.locator("[data-stop]")).to_have_text("Stop the fingers")
    page.get_by_label("To the width, mm").fill("40,4")
    follow(page.get_by_role("button", name="Move", exact=True))
    fingers = page.get_by_text(re.compile(r"The fingers are at [\d.]+ mm"))
    expect(fingers).to_be_visible()
    width_mm = float(re.findall(r"[\d.]+", fingers.inner_text())[0])
    assert abs(width_mm - 40.4) < 0.3
    assert not orchard.state().ready
    expect(page.locator("[data-poll] .big")).to_have_text(f"{width_mm:.1f} mm")
    follow(page.get_by_role("button", name="+ 1 mm"))
    expect(fingers).not_to_contain_text(f"{width_mm:.1f}")
    wider_mm = float(re.findall(r"[\d.]+", fingers.inner_text())[0])
    assert 0.5 < wider_mm - width_mm < 1.5
    width_mm = wider_mm
    follow(page.get_by_role("button", name="Open", exact=True))
    expect(fingers).not_to_contain_text(f"{width_mm:.1f}")
    follow(page.get_by_role("button", name="Back to production"))
    expect(page.get_by_role("button", name="Set manual mode")).to_be_visible()
    assert orchard.state().mode == 1
    start(person, orchard, eventually)


def test_the_live_image_goes_on_and_registers_are_told_by_name(orchard: Any, panel: Any) -> None:
    person = panel()
    page = person.go("/maintenance/image")
    picture = page.locator(".live img")
    first = picture.get_attribute("src")
    expect(picture).not_to_have_attribute("src", first or "")
    assert page.locator(".bars").count() == 3
    page = person.go("/maintenance/registers")
    row = page.locator("tr", has_text="reference_u16")
    expect(row).to_contain_text("4660")
    expect(page.locator("tr", has_text="packml_mode")).to_contain_text("production")


def test_a_live_image_is_asked_for_no_faster_than_the_browser_takes_it(orchard: Any, panel: Any) -> None:
    page = panel().go("/maintenance/image")
    requested: list[str] = []
    held = holding(page, "**/maintenance/image/*.jpg")
    page.on("request", lambda request: requested.append(request.url) if "/image/part" in request.url else None)
    while not held:
        page.wait_for_timeout(50)
    before = len(requested)
    page.wait_for_timeout(1500)  # seven times the pause between two
    assert (len(requested), len(held)) == (before, 1), "the next is not requested before this one was taken"
    page.unroute("**/maintenance/image/*.jpg")  # which lets it go on
    with page.expect_request("**/maintenance/image/part*"):
        pass


def test_what_a_page_asks_for_itself_is_greyed_where_no_answer_comes(orchard: Any, panel: Any) -> None:
    page = panel().go("/maintenance/registers")
    holding(page, "**/maintenance/registers/part")
    part = page.locator("[data-poll]")
    expect(part).to_have_class(re.compile("old-part"))
    assert re.search(r"No data for \d+ s", part.get_attribute("data-old") or "")
    assert part.evaluate("part => part.inert")
    assert page.locator("body:not(.stale)").count() == 1, "the station itself is heard"
    page.unroute("**/maintenance/registers/part")
    expect(part).not_to_have_class(re.compile("old-part"))
    assert not part.evaluate("part => part.inert")


def test_what_a_finger_keeps_from_being_renewed_is_greyed(orchard: Any, panel: Any) -> None:
    page = panel().go("/maintenance/registers")
    part = page.locator("[data-poll]")
    part.hover()
    page.mouse.down()  # the heartbeat changes with each answer
    expect(part).to_have_class(re.compile("old-part"))
    page.mouse.up()
    expect(part).not_to_have_class(re.compile("old-part"))


def test_a_verification_without_a_calibration_says_what_to_do(orchard: Any, panel: Any) -> None:
    person = panel("Max")
    expect(person.go("/maintenance/sensor").get_by_text("set manual mode, 3, first")).to_be_visible()
    with orchard.manual_mode():
        page = person.go("/maintenance/sensor")
        expect(page.get_by_role("button", name="Calibrate")).to_be_visible()
        assert page.get_by_role("button", name="Verify").count() == 0
        assert page.get_by_text("None yet.").count() == 2


def test_the_mode_is_set_on_the_tab_of_the_ball_too(orchard: Any, panel: Any, eventually: Callable[..., Any]) -> None:
    person = panel("Max")
    page = person.go("/maintenance/sensor")
    follow(page.get_by_role("button", name="Set manual mode"))
    expect(page.get_by_role("button", name="Calibrate")).to_be_visible()
    follow(page.get_by_role("button", name="Back to production"))
    expect(page.get_by_text("set manual mode, 3, first")).to_be_visible()
    assert orchard.state().mode == 1
    start(person, orchard, eventually)


def test_places_are_typed_at_a_panel_one_per_line(orchard: Any, panel: Any) -> None:
    person = panel("Max", locale="es")
    person.go("/panel")
    with orchard.manual_mode():
        page = person.go("/maintenance/sensor")
        board = page.locator("[data-keyboard]")
        page.locator("[name=places]").click()
        board.locator(".keycap-layer").click()
        for key in ("4", ";", "Espacio", "0", "Línea nueva", "0", ";", "Espacio", "3"):
            board.get_by_role("button", name=key, exact=True).click()
        assert set("[]{}<>|\\*¿") <= set(board.inner_text())
        boxes = [key.bounding_box() for key in board.get_by_role("button").all()]
        assert min(box["height"] for box in boxes) >= KEY_PX
        assert min(box["width"] for box in boxes) >= KEY_PX
        board.locator(".keycap-done").click()
        page.route("**/sensor/begin", lambda route: route.abort())
        with page.expect_request("**/sensor/begin") as sent:
            page.locator("form:has([name=places])").evaluate("form => form.requestSubmit()")
        assert parse_qs(sent.value.post_data)["places"] == ["4; 0\r\n0; 3"]


def test_maintenance_downloads_a_support_bundle_and_a_viewer_does_not(
    orchard: Any, panel: Any, eventually: Callable[..., Any]
) -> None:
    viewer = panel()
    assert viewer.go("/maintenance").get_by_role("link", name="Download the support bundle").count() == 0
    assert viewer.context.request.get(f"{viewer.address}/maintenance/support.zip").status == 403
    page = panel("Max").go("/maintenance")
    with page.expect_download() as coming:
        page.get_by_role("link", name="Download the support bundle").click()
    assert re.fullmatch(r"support-\d{8}T\d{6}Z\.zip", coming.value.suggested_filename)
    with zipfile.ZipFile(coming.value.path()) as archive:
        parts = {name: archive.read(name).decode() for name in archive.namelist()}
    assert json.loads(parts["configuration.json"])["home"] == str(orchard.home)
    assert "LOT 1" in parts["inspections.txt"], "by the station's own records"
    assert "fruit" in parts["metrics.txt"], "by the running station"
    assert not any("$argon2" in text for text in parts.values())
    eventually(lambda: [row for row in audited(orchard, "panel.support_bundle") if row.who == "Max"])


def test_an_administrator_edits_the_configuration_and_takes_it_back(
    orchard: Any, panel: Any, eventually: Callable[..., Any]
) -> None:
    assert panel("Max").go("/maintenance").get_by_role("link", name="Configuration").count() == 0
    file = orchard.home.parent / "station.yaml"
    before = file.read_text()
    earlier = len(audited(orchard, "panel.configuration_saved"))
    page = panel("Ada").go("/maintenance")
    follow(page.get_by_role("link", name="Configuration"))
    text = page.get_by_label("Text of the file")
    expect(text).to_have_value(before)
    text.fill(f"# why\n{before}\nmodbus: 3\n")
    follow(page.get_by_role("button", name="Check and save"))
    expect(page.locator("[data-mistakes]")).to_contain_text("Line 3")
    assert file.read_text() == before
    found = [each for each in Axe().run(page).response["violations"] if each["impact"] in {"serious", "critical"}]
    assert not found, [(each["id"], [node["target"] for node in each["nodes"][:3]]) for each in found]
    for width_px in (1280, 390):
        page.set_viewport_size({"width": width_px, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), width_px
    text.fill(before.replace('"idle_s": 3600.0', '"idle_s": 3000.0'))
    follow(page.get_by_role("button", name="Check and save"))
    expect(page.get_by_text("Saved. It takes effect at the next start.")).to_be_visible()
    assert '"idle_s": 3000.0' in file.read_text()
    follow(page.get_by_role("button", name="Put the former file back"))
    expect(page.get_by_label("Text of the file")).to_have_value(before)
    assert file.read_text() == before
    rows = eventually(lambda: (new := audited(orchard, "panel.configuration_saved")[: -earlier or None])[1:] and new)
    assert [(json.loads(row.old), json.loads(row.new)) for row in rows] == [
        ({"hmi.idle_s": 3000.0}, {"hmi.idle_s": 3600.0}),
        ({"hmi.idle_s": 3600.0}, {"hmi.idle_s": 3000.0}),
    ]
