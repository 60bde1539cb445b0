"""The history page in a real browser: search, one inspection, tables and reports."""

import json
import sqlite3
from typing import Any

import pytest
from playwright.sync_api import expect

from hmi.web.roles import Role
from station.records.database import FILE_NAME, records_folder
from tests.chromium import follow

pytestmark = pytest.mark.timeout(400)

OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def test_a_fruit_is_found_by_its_number_and_its_page_says_why(orchard: Any, panel: Any) -> None:
    soft = orchard.soft
    page = panel().go("/history")
    page.get_by_text("More conditions").click()
    page.get_by_label("Fruit number").fill(str(soft.sequence))
    follow(page.get_by_role("button", name="Search"))
    expect(page.get_by_role("heading", name=f"Fruit {soft.sequence}")).to_be_visible()
    assert page.locator(".reasons li").count() == len(soft.reasons)
    assert page.locator(".mark-point").count() >= 2
    expect(page.get_by_text("fruit length 48.0 mm, class 3 (given by the PLC)")).to_be_visible()
    follow(page.locator(".steps a").nth(1))
    expect(page.get_by_role("heading", name="Step 1")).to_be_visible()
    pictures = page.locator(".stages img")
    assert pictures.count() >= 8
    sizes = pictures.evaluate_all("all => Promise.all(all.map(each => each.decode().then(() => each.naturalWidth)))")
    assert all(size == 480 for size in sizes)


def test_why_a_fruit_was_diverted_is_said_in_german(orchard: Any, panel: Any) -> None:
    page = panel("", locale="de").go(f"/history/{orchard.soft.sequence}")
    why = page.locator("section[aria-labelledby=why]")
    expect(why).to_contain_text("mm Schließweg")
    assert why.locator("[lang=en]").count() == 0


def test_a_record_of_before_messages_is_shown_in_english_and_marked(
    orchard: Any, panel: Any, api: Any, token_of: Any
) -> None:
    text, number = "The area at 3 mm of closing was over the limit.", orchard.fruit[0].sequence
    database = sqlite3.connect(records_folder(orchard.home) / FILE_NAME, timeout=60)
    (before,) = database.execute("SELECT explanation FROM inspections WHERE sequence = ?", (number,)).fetchone()
    change = "UPDATE inspections SET explanation = ? WHERE sequence = ?"
    try:
        with database:
            database.execute(change, (json.dumps([text]), number))
        page = panel("", locale="de").go(f"/history/{number}")
        expect(page.locator("section[aria-labelledby=why] p [lang=en]")).to_have_text(text)
        whole = api("GET", f"/api/v1/inspections/{number}", token=token_of("before", Role.VIEWER)).body
        assert whole["explanation"] == [text]
        assert whole["messages"] == [{"id": "text.verbatim", "parameters": {"text": text}, "text": text}]
    finally:
        with database:
            database.execute(change, (before, number))
        database.close()


def test_a_number_is_taken_as_people_write_it_and_one_that_is_none_is_said(orchard: Any, panel: Any) -> None:
    page = panel(locale="de").go("/history")
    page.get_by_text("Weitere Bedingungen").click()
    page.locator("[name=number]").fill("4.711")
    follow(page.locator("[role=search] .main"))
    expect(page.locator("main")).to_contain_text("es gibt keine Prüfung 4711; aufgezeichnet sind")
    page = panel().go("/history")
    page.get_by_text("More conditions").click()
    page.locator("[name=number]").fill("fruit 7")
    follow(page.get_by_role("button", name="Search"))
    expect(page.get_by_role("alert")).to_contain_text("Invalid search")


def test_a_search_by_fruit_shows_its_inspections(orchard: Any, panel: Any) -> None:
    page = panel().go("/history")
    page.get_by_text("More conditions").click()
    page.get_by_role("radio", name="Strawberry").check(force=True)
    follow(page.get_by_role("button", name="Search"))
    shown = [int(text) for text in page.locator(".row-number").all_inner_texts()]
    assert shown == [outcome.sequence for outcome in orchard.fruit][::-1][:20]
    assert panel().go("/history?fruit=raspberry").locator(".row-number").count() == 0


def test_one_touch_finds_todays_rejects(orchard: Any, panel: Any) -> None:
    page = panel().go("/history")
    follow(page.get_by_role("link", name="Today", exact=True))
    follow(page.get_by_role("link", name="Fail", exact=True))
    assert page.locator(".chips [aria-current]").all_inner_texts() == ["Today", "Fail"]

    def shown() -> set[int]:
        return {int(text) for text in page.locator(".row-number").all_inner_texts()}

    today = shown()
    follow(page.get_by_role("link", name="The day before"))
    before = shown()  # fruit inspected before a midnight that has just passed
    assert not today & before
    rejects = today | before
    assert rejects == {outcome.sequence for outcome in orchard.fruit if outcome.outcome == "FAIL"}
    follow(page.get_by_role("link", name="The day before"))
    expect(page.get_by_text("Nothing was found.")).to_be_visible()


def test_a_search_by_reason_shows_those_and_no_others(orchard: Any, panel: Any) -> None:
    soft = orchard.soft
    page = panel().go(f"/history?reason={soft.reasons[0]}")
    shown = {int(text) for text in page.locator(".row-number").all_inner_texts()}
    assert shown == {outcome.sequence for outcome in orchard.fruit if soft.reasons[0] in outcome.reasons}


def test_the_audit_trail_is_sentences(orchard: Any, panel: Any) -> None:
    page = panel("", locale="de").go("/history/audit")
    expect(page.get_by_text("Hat die Frucht auf Erdbeere gewechselt.").first).to_be_visible()
    text = page.locator("main").inner_text()
    assert not any(sign in text for sign in ("{", "command.", "panel.", "lot.started"))


def test_a_table_and_a_lots_report_are_written_and_fetched(orchard: Any, panel: Any) -> None:
    person = panel("Quin")
    page = person.go("/history?fruit=strawberry")
    page.get_by_text("Tables and reports").click()
    follow(page.get_by_role("button", name="CSV"))
    expect(page.get_by_role("link", name="Save inspections.csv")).to_be_visible()
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate(OVERFLOW) == 0
    with page.expect_download() as download:
        page.get_by_role("link", name="Save inspections.csv").click()
    lines = download.value.path().read_text().splitlines()
    assert len(lines) == 1 + len(orchard.fruit)
    page = person.go("/history")
    page.get_by_text("Tables and reports").click()
    page.get_by_label("Report of lot").fill("LOT 1")
    follow(page.get_by_role("button", name="Printable report"))
    follow(page.get_by_role("link", name="Open lot.html"))
    with page.expect_popup() as alone:
        page.get_by_role("link", name="Open alone, to print").click()
    expect(alone.value.get_by_text("Lot LOT 1").first).to_be_visible()


def test_a_panel_shows_a_report_within_a_page_and_offers_no_file(orchard: Any, panel: Any) -> None:
    """A panel's browser has no keyboard and no way back; it saves and prints nothing."""
    person = panel("Max")
    person.go("/panel")
    page, nothing_saved = person.go("/history"), "This screen saves and prints no files."
    page.get_by_text("Tables and reports").click()
    expect(page.get_by_role("button", name="CSV")).to_have_count(0)
    page.get_by_label("Report of lot").fill("LOT 1")
    page.locator("[data-keyboard]").get_by_role("button", name="Done").click()
    follow(page.get_by_role("button", name="Printable report"))
    follow(page.get_by_role("link", name="Open lot.html"))
    for width, height in ((390, 844), (1280, 800)):
        page.set_viewport_size({"width": width, "height": height})
        expect(page.frame_locator("iframe").get_by_text("Lot LOT 1").first).to_be_visible()
        expect(page.locator(".alarm-line")).to_be_visible()
        expect(page.locator("nav.pages").get_by_role("link", name="Run")).to_be_visible()
        assert page.evaluate(OVERFLOW) == 0
    assert page.locator("[target], [href*='/file/'], [href*='/document/']").count() == 0
    follow(page.get_by_role("link", name="Back"))
    expect(page.get_by_role("link", name="Open lot.html")).to_be_visible()
    for path in (page.url.removeprefix(person.address), "/maintenance", "/recipes/strawberry/text"):
        page = person.go(path)
        expect(page.get_by_text(nothing_saved)).to_be_visible()
        assert page.locator("[href*='/file/'], [href$='.zip'], [href$='/export']").count() == 0, path


def test_the_arrows_lead_to_fruit_that_there_are(orchard: Any, panel: Any) -> None:
    person = panel()
    numbers = [outcome.sequence for outcome in orchard.fruit]
    first, last = (
        person.go(f"/history/{number}").locator(".steps-nav a").all_inner_texts()
        for number in (min(numbers), max(numbers))
    )
    assert str(min(numbers) - 1) not in first
    assert str(min(numbers) + 1) in first
    assert str(max(numbers) + 1) not in last
    assert str(max(numbers) - 1) in last


def test_a_job_that_is_done_cannot_be_cancelled(orchard: Any, panel: Any) -> None:
    page = panel("Quin").go("/history")
    page.get_by_text("Tables and reports").click()
    follow(page.get_by_role("button", name="Printable report"))
    expect(page.get_by_role("link", name="Open lot.html")).to_be_visible()
    expect(page.get_by_role("button", name="Cancel")).to_be_hidden()


def test_a_finger_on_the_page_at_a_jobs_end_does_not_keep_the_end_from_being_shown(orchard: Any, panel: Any) -> None:
    def in_progress(route: Any) -> None:
        route.fulfill(content_type="text/html", body='<p class="lead">In progress</p>')

    page = panel("Quin").go("/history")
    page.route("**/jobs/*/part**", in_progress)
    page.get_by_text("Tables and reports").click()
    follow(page.get_by_role("button", name="Printable report"))
    part = page.locator("[data-poll]")
    part.hover()
    page.mouse.down()
    page.unroute("**/jobs/*/part**")
    for _ in range(2):  # the page requests the second one when it has taken the first
        with page.expect_response(lambda answer: answer.headers.get("x-over") == "1"):
            pass
    expect(part).to_contain_text("In progress")
    page.mouse.up()
    expect(part).to_contain_text("Done")
    expect(page.get_by_role("button", name="Cancel")).to_be_hidden()
