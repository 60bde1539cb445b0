"""The pages Recipes, History and Maintenance, as people use them in a real browser."""

import json
import re
import sqlite3
from collections.abc import Callable
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from hmi.web.roles import Role
from hmi.web.translation import Locale
from station.channel.panel_queries import AuditRows, ReadAudit
from station.records.database import FILE_NAME, records_folder
from station.settings.hmi import LANGUAGES, Language
from station.settings.recipe import load_recipes

pytestmark = pytest.mark.timeout(400)

PAGES = (
    "/recipes",
    "/recipes/strawberry",
    "/recipes/strawberry/edit",
    "/recipes/strawberry/history",
    "/recipes/strawberry/text",
    "/history",
    "/history/audit",
    "/history/SOFT",
    "/history/SOFT/step/1",
    "/maintenance",
    "/maintenance/hand",
    "/maintenance/image",
    "/maintenance/sensor",
    "/maintenance/registers",
    "/maintenance/log",
)
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def audited(site: Any, action: str) -> list[Any]:
    asked = ReadAudit(action=action)
    return list(site.over_the_panel(lambda client: client.request(asked, AuditRows, deadline_s=20)).rows)


def edit(page: Page, field: str, value: str) -> None:
    page.locator(f'[name="v:{field}"]').fill(value)


def holding(page: Page, address: str) -> list[Any]:
    """Keeps what a page asks for from being answered; gives what was asked."""
    held: list[Any] = []

    def hold(route: Any) -> None:
        held.append(route)

    page.route(address, hold)
    return held


@pytest.mark.parametrize("path", PAGES)
def test_a_page_fits_both_screens_and_is_accessible(orchard: Any, panel: Any, path: str) -> None:
    person = panel("Ada")
    page = person.go(path.replace("SOFT", str(orchard.soft.sequence)))
    assert page.evaluate(OVERFLOW) == 0
    found = [each for each in Axe().run(page).response["violations"] if each["impact"] in {"serious", "critical"}]
    assert not found, [(each["id"], [node["target"] for node in each["nodes"][:3]]) for each in found]
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(100)
    assert page.evaluate(OVERFLOW) == 0


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_every_page_fits_where_nobody_is_logged_in(orchard: Any, panel: Any, size: tuple[int, int]) -> None:
    person = panel("", *size)
    for path in PAGES:
        page = person.go(path.replace("SOFT", str(orchard.soft.sequence)))
        assert page.evaluate(OVERFLOW) == 0, path


@pytest.mark.parametrize("locale", LANGUAGES[1:])
def test_pages_speak_the_browsers_language(orchard: Any, panel: Any, locale: Language) -> None:
    person = panel("", locale=locale)
    for path in ("/recipes/strawberry/edit", "/history", f"/history/{orchard.soft.sequence}", "/maintenance"):
        page = person.go(path)
        assert page.evaluate("document.documentElement.lang") == locale
        assert page.evaluate(OVERFLOW) == 0
    limit = person.go("/recipes/strawberry/edit").locator('[name="v:steps.closing_limit_mm"]')
    assert limit.input_value() == f"4{Locale(locale).decimal_sign}5"


def test_a_draft_is_written_shown_on_past_curves_rejected_and_another_approved(orchard: Any, panel: Any) -> None:
    quin, rosa = panel("Quin"), panel("Rosa")
    file = orchard.configuration.recipes_folder / "strawberry.yaml"
    comments = [line for line in file.read_text().splitlines() if line.lstrip().startswith("#")]
    page = quin.go("/recipes/strawberry/edit")
    mark = page.locator("[data-chart-here] .limit").first
    before = mark.get_attribute("d")
    edit(page, "damage.area[0].area_mm2", "96,5")
    expect(mark).not_to_have_attribute("d", before or "")
    page.locator("[name=reason]").fill("softer fruit were let through")
    page.get_by_role("button", name="Save as a draft").click()
    expect(page.get_by_text("waits for approval")).to_be_visible()
    expect(page.get_by_role("cell", name="damage.area[0].area_mm2")).to_be_visible()
    assert page.get_by_role("button", name="Approve").count() == 0, "its author cannot approve it"
    assert comments == [line for line in file.read_text().splitlines() if line.lstrip().startswith("#")]

    page = rosa.go("/recipes/strawberry")
    page.locator("form[action$='/approve'] [name=reason]").fill("too strict")
    page.get_by_role("button", name="Reject").click()
    expect(page.get_by_role("button", name="Restore the file")).to_be_visible()
    page = quin.go("/recipes/strawberry/edit")
    edit(page, "damage.area[0].area_mm2", "105")
    page.locator("[name=reason]").fill("a little softer")
    page.get_by_role("button", name="Save as a draft").click()
    expect(page.get_by_text("waits for approval")).to_be_visible()
    page = rosa.go("/recipes/strawberry")
    page.locator("form[action$='/approve'] [name=reason]").fill("seen on the curves")
    page.get_by_role("button", name="Approve").click()
    expect(page.get_by_text("No difference from the recipe in force.")).to_be_visible()
    assert load_recipes(file.parent)["strawberry"].damage.area[0].area_mm2 == 105
    done = [(row.who, row.role, row.action) for row in audited(orchard, "recipe.")[:6]]
    assert ("Rosa", "quality", "recipe.approved") in done
    assert ("Rosa", "quality", "recipe.retired") in done
    assert ("Quin", "quality", "recipe.submitted") in done
    told = rosa.go("/recipes/strawberry/history").locator("main").inner_text()
    assert "too strict" in told
    assert "seen on the curves" in told


def test_a_bad_draft_is_refused_beside_the_form_and_nothing_is_written(orchard: Any, panel: Any) -> None:
    person = panel("Quin")
    file = orchard.configuration.recipes_folder / "raspberry.yaml"
    before = file.read_text()
    page = person.go("/recipes/raspberry/edit")
    edit(page, "damage.growth_mm2_per_mm", "9999")
    page.locator("[name=reason]").fill("a slip")
    page.get_by_role("button", name="Save as a draft").click()
    expect(page.get_by_role("alert")).to_contain_text("growth_mm2_per_mm")
    assert page.locator('[name="v:damage.growth_mm2_per_mm"]').input_value() == "9999"
    assert file.read_text() == before


def test_a_viewer_is_shown_recipes_and_may_not_change_them(orchard: Any, panel: Any) -> None:
    person = panel()
    page = person.go("/recipes/blueberry/edit")
    assert page.get_by_role("button", name="Save as a draft").count() == 0
    token = person.go("/people").locator("input[name=csrf]").first.get_attribute("value")
    form = {"csrf": token, "reason": "x", "base": "0" * 64, "v:damage.growth_mm2_per_mm": "50"}
    answer = person.context.request.post(f"{person.address}/recipes/blueberry/draft", form=form)
    assert answer.status == 403


def test_a_fruit_is_found_by_its_number_and_its_page_says_why(orchard: Any, panel: Any) -> None:
    soft = orchard.soft
    page = panel().go("/history")
    page.get_by_label("Fruit number").fill(str(soft.sequence))
    page.get_by_role("button", name="Search").click()
    expect(page.get_by_role("heading", name=f"Fruit {soft.sequence}")).to_be_visible()
    assert page.locator(".reasons li").count() == len(soft.reasons)
    assert page.locator(".mark-point").count() >= 2
    expect(page.get_by_text("fruit length 48.0 mm, class 3 (given by the PLC)")).to_be_visible()
    page.locator(".steps a").nth(1).click()
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
    told, number = "The area at 3 mm of closing was over the limit.", orchard.fruit[0].sequence
    database = sqlite3.connect(records_folder(orchard.home) / FILE_NAME, timeout=60)
    (before,) = database.execute("SELECT explanation FROM inspections WHERE sequence = ?", (number,)).fetchone()
    change = "UPDATE inspections SET explanation = ? WHERE sequence = ?"
    try:
        with database:
            database.execute(change, (json.dumps([told]), number))
        page = panel("", locale="de").go(f"/history/{number}")
        expect(page.locator("section[aria-labelledby=why] p [lang=en]")).to_have_text(told)
        whole = api("GET", f"/api/v1/inspections/{number}", token=token_of("before", Role.VIEWER)).body
        assert whole["explanation"] == [told]
        assert whole["messages"] == [{"id": "text.verbatim", "parameters": {"text": told}, "text": told}]
    finally:
        with database:
            database.execute(change, (before, number))
        database.close()


def test_a_number_is_taken_as_people_write_it_and_one_that_is_none_is_said(orchard: Any, panel: Any) -> None:
    page = panel(locale="de").go("/history")
    page.locator("[name=number]").fill("4.711")
    page.locator(".search .main, .search button").first.click()
    expect(page.locator("main")).to_contain_text("es gibt keine Prüfung 4711; aufgezeichnet sind")
    page = panel().go("/history")
    page.locator("[name=number]").fill("fruit 7")
    page.get_by_role("button", name="Search").click()
    expect(page.get_by_role("alert")).to_contain_text("Invalid search")


def test_a_search_by_fruit_shows_its_inspections(orchard: Any, panel: Any) -> None:
    page = panel().go("/history")
    page.get_by_label("Recipe").select_option("strawberry")
    page.get_by_role("button", name="Search").click()
    shown = [int(text) for text in page.locator(".row-number").all_inner_texts()]
    assert shown == [outcome.sequence for outcome in orchard.fruit][::-1][:20]
    assert panel().go("/history?fruit=raspberry").locator(".row-number").count() == 0


def test_a_search_by_reason_shows_those_and_no_others(orchard: Any, panel: Any) -> None:
    soft = orchard.soft
    page = panel().go(f"/history?reason={soft.reasons[0]}")
    shown = {int(text) for text in page.locator(".row-number").all_inner_texts()}
    assert shown == {outcome.sequence for outcome in orchard.fruit if soft.reasons[0] in outcome.reasons}


def test_a_table_and_a_lots_report_are_written_and_fetched(orchard: Any, panel: Any) -> None:
    person = panel("Quin")
    page = person.go("/history?fruit=strawberry")
    page.get_by_text("Tables and reports").click()
    page.get_by_role("button", name="CSV").click()
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
    page.get_by_role("button", name="Printable report").click()
    page.get_by_role("link", name="Open lot.html").click()
    expect(page.get_by_text("Lot LOT 1").first).to_be_visible()


def test_a_draft_is_tried_on_what_was_inspected(orchard: Any, panel: Any) -> None:
    page = panel("Quin").go("/recipes/strawberry")
    page.get_by_role("button", name="What would it have decided?").click()
    page.get_by_role("link", name="Open whatif.html").click()
    expect(page.get_by_text("What if: Strawberry").first).to_be_visible()


def test_jogging_is_refused_out_of_manual_mode_and_done_in_it(
    orchard: Any, panel: Any, eventually: Callable[..., Any]
) -> None:
    person = panel("Max")
    page = person.go("/maintenance/hand")
    expect(page.get_by_text("set manual mode, 3, first")).to_be_visible()
    page.get_by_label("Width, mm").fill("40")
    page.get_by_role("button", name="Move", exact=True).click()
    expect(page.get_by_text("The station is in mode 1")).to_be_visible()
    eventually(lambda: [row for row in audited(orchard, "maintenance.jog") if row.who == "Max"])
    page = person.go("/maintenance/hand")
    page.get_by_role("button", name="Set manual mode").click()
    expect(page.get_by_role("button", name="Back to production")).to_be_visible()
    page.get_by_label("Width, mm").fill("40,4")
    page.get_by_role("button", name="Move", exact=True).click()
    told = page.get_by_text(re.compile(r"The fingers are at [\d.]+ mm"))
    expect(told).to_be_visible()
    width_mm = float(re.findall(r"[\d.]+", told.inner_text())[0])
    assert abs(width_mm - 40.4) < 0.3
    assert not orchard.state().ready
    page.get_by_role("button", name="Open", exact=True).click()
    expect(told).not_to_contain_text(f"{width_mm:.1f}")
    page.get_by_role("button", name="Back to production").click()
    expect(page.get_by_role("button", name="Set manual mode")).to_be_visible()
    assert orchard.state().mode == 1


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
    asked: list[str] = []
    held = holding(page, "**/maintenance/image/*.jpg")
    page.on("request", lambda request: asked.append(request.url) if "/image/part" in request.url else None)
    while not held:
        page.wait_for_timeout(50)
    before = len(asked)
    page.wait_for_timeout(1500)  # seven times the pause between two
    assert (len(asked), len(held)) == (before, 1), "the next is not asked for before this one was taken"
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


def test_a_verification_without_a_calibration_says_what_to_do(orchard: Any, panel: Any) -> None:
    person = panel("Max")
    expect(person.go("/maintenance/sensor").get_by_text("set manual mode, 3, first")).to_be_visible()
    with orchard.manual_mode():
        page = person.go("/maintenance/sensor")
        expect(page.get_by_role("button", name="Calibrate")).to_be_visible()
        assert page.get_by_role("button", name="Verify").count() == 0
        assert page.get_by_text("None yet.").count() == 2
