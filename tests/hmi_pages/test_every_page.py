"""Recipes, History and Maintenance in a real browser: both sizes, accessibility, languages."""

from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

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
SET_UP = "/maintenance/setup"
"""For administrators alone."""
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def edit(page: Page, field: str, value: str) -> None:
    page.locator(f'[name="v:{field}"]').fill(value)


@pytest.mark.parametrize("path", [*PAGES, SET_UP])
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
