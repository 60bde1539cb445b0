"""Recipes, History and Maintenance in a real browser: both sizes, accessibility, languages."""

from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from hmi.web.translation import Locale
from station.settings.hmi import LANGUAGES, Language

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
CUT = """() => {
  const found = [];
  for (const text of document.querySelectorAll("svg text")) {
    const [box, whole] = [text.getBoundingClientRect(), text.closest("svg").getBoundingClientRect()];
    if (text.checkVisibility() && (box.left < whole.left - 1 || box.right > whole.right + 1)) {
      found.push(`outside its chart: ${text.textContent}`);
    }
  }
  for (const button of document.querySelectorAll(".button")) {
    if (button.checkVisibility() && button.scrollWidth > button.clientWidth) {
      found.push(`wider than its button: ${button.textContent}`);
    }
  }
  const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode;
    if (!node.parentElement.checkVisibility() || node.parentElement.closest("svg, .sr, .mono, pre, option")) {
      continue;
    }
    for (const word of node.data.matchAll(/\\p{L}{4,}/gu)) {
      const range = document.createRange();
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map((each) => Math.round(each.top))).size > 1) {
        found.push(`a word on two lines: ${word[0]}`);
      }
    }
  }
  return found;
}"""
"""Texts that a person cannot read whole."""
SET_UP = "/maintenance/setup"
"""For administrators alone."""
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def edit(page: Page, field: str, value: str) -> None:
    page.locator(f'[name="v:{field}"]').fill(value)


@pytest.mark.timeout(900)
def test_every_page_fits_both_screens_and_is_accessible(orchard: Any, panel: Any) -> None:
    person = panel("Ada")
    found = {}
    for path in (*PAGES, SET_UP):
        person.page.set_viewport_size({"width": 1280, "height": 800})
        page = person.go(path.replace("SOFT", str(orchard.soft.sequence)))
        too_wide_px = [page.evaluate(OVERFLOW)]
        violations = [
            (each["id"], [node["target"] for node in each["nodes"][:3]])
            for each in Axe().run(page).response["violations"]
            if each["impact"] in {"serious", "critical"}
        ]
        page.set_viewport_size({"width": 390, "height": 844})
        page.wait_for_timeout(100)
        too_wide_px.append(page.evaluate(OVERFLOW))
        found[path] = too_wide_px, violations
    assert found == dict.fromkeys(found, ([0, 0], []))


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


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_text_is_cut_off(orchard: Any, panel: Any, language: Language) -> None:
    soft = orchard.soft.sequence
    paths = ("/", "/people", "/recipes", "/recipes/strawberry", f"/history/{soft}", f"/history/{soft}/step/1",
             "/maintenance", "/maintenance/hand", "/maintenance/registers", "/maintenance/log")  # fmt: skip
    person, viewer = panel("Ada", locale=language), panel(locale=language)
    for each, path in [*((person, path) for path in paths), (viewer, "/people")]:
        page = each.go(path)
        page.locator("details > summary").evaluate_all("all => all.forEach((each) => { each.parentNode.open = true })")
        for width, height in ((1280, 800), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate(CUT) == [], f"{path} {width}"


def test_a_disabled_choice_shows_its_label_alone(orchard: Any, panel: Any) -> None:
    choice = panel().go("/maintenance/hand").locator(".choices input").first
    assert choice.is_disabled()
    assert choice.evaluate("each => getComputedStyle(each).opacity") == "0", "the browser's own sign is not seen"


def test_a_station_that_waits_out_of_production_is_idle_not_ready(orchard: Any, panel: Any, eventually: Any) -> None:
    eventually(orchard.ready)
    page = panel().go("/")
    shown = page.locator(".activity-head, .station-state b")
    expect(shown).to_have_text(["Ready", "Ready"])
    with orchard.manual_mode():
        expect(shown).to_have_text(["Idle", "Idle"])
