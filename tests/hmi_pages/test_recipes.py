"""The recipes page in a real browser: drafts, approval, what-if; and its form and strip chart without one."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import Page, expect

from hmi.recipes.form import BadFieldError, changed, formatted, groups
from hmi.recipes.strip import strip
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.records.audit_report import read_audit
from station.records.database import reading
from station.records.marks import place_mark
from station.records.short_transaction import short_transaction
from station.settings.recipe import load_recipes
from tests.chromium import follow

pytestmark = pytest.mark.timeout(400)


def audited(site: Any, action: str) -> list[Any]:
    with reading(site.home / "records") as connection:
        return read_audit(connection, 50, action, "")[::-1]


def edit(page: Page, field: str, value: str) -> None:
    page.locator(f'[name="v:{field}"]').fill(value)


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
    follow(page.get_by_role("button", name="Save as a draft"))
    expect(page.get_by_text("waits for approval")).to_be_visible()
    expect(page.get_by_role("cell", name="damage.area[0].area_mm2")).to_be_visible()
    assert page.get_by_role("button", name="Approve").count() == 0, "its author cannot approve it"
    assert comments == [line for line in file.read_text().splitlines() if line.lstrip().startswith("#")]

    page = rosa.go("/recipes/strawberry")
    page.locator("form[action$='/approve'] [name=reason]").fill("too strict")
    follow(page.get_by_role("button", name="Reject"))
    expect(page.get_by_role("button", name="Restore the file")).to_be_visible()
    page = quin.go("/recipes/strawberry/edit")
    edit(page, "damage.area[0].area_mm2", "105")
    page.locator("[name=reason]").fill("a little softer")
    follow(page.get_by_role("button", name="Save as a draft"))
    expect(page.get_by_text("waits for approval")).to_be_visible()
    page = rosa.go("/recipes/strawberry")
    page.locator("form[action$='/approve'] [name=reason]").fill("seen on the curves")
    follow(page.get_by_role("button", name="Approve"))
    expect(page.get_by_text("No difference from the recipe in force.")).to_be_visible()
    assert load_recipes(file.parent)["strawberry"].damage.area[0].area_mm2 == 105
    done = [(row.who, row.role, row.action) for row in audited(orchard, "recipe.")[:6]]
    assert ("Rosa", "quality", "recipe.approved") in done
    assert ("Rosa", "quality", "recipe.retired") in done
    assert ("Quin", "quality", "recipe.submitted") in done
    text = rosa.go("/recipes/strawberry/history").locator("main").inner_text()
    assert "too strict" in text
    assert "seen on the curves" in text


def test_a_slider_moves_the_limit_and_the_limit_moves_the_slider(panel: Any) -> None:
    page = panel("Quin").go("/recipes/strawberry/edit")
    field, slider = page.locator('[name="v:damage.area[0].area_mm2"]'), page.get_by_role("slider").first
    mark = page.locator("[data-chart-here] .limit").first
    before, stored = mark.get_attribute("d"), float(slider.input_value())
    slider.press("ArrowLeft")
    expect(field).to_have_value(f"{stored - 0.5:g}")
    expect(mark).not_to_have_attribute("d", before or "")
    field.fill(f"{stored + 1:g},5")
    expect(slider).to_have_value(f"{stored + 1.5:g}")


def test_the_typed_values_are_tried_on_past_fruit_and_against_the_marks(orchard: Any, panel: Any) -> None:
    person = panel("Quin")
    tried = person.go("/recipes/strawberry/edit").locator("[data-chart-here] .tried")
    expect(tried).to_contain_text("No fruit of this recipe is marked")
    with short_transaction(orchard.home / "records") as connection:
        place_mark(connection, 1, "bad", "Ida")  # the good one: its press is whole, so it is known in every run
    tried = person.go("/recipes/strawberry/edit").locator("[data-chart-here] .tried")
    expect(tried).to_contain_text("Marked bad and passed: 1 of 1, 1 before")
    edit(person.page, "early_stop.area_mm2", "5")
    expect(tried).to_contain_text("no valid recipe")


def test_a_bad_draft_is_refused_beside_the_form_and_nothing_is_written(orchard: Any, panel: Any) -> None:
    person = panel("Quin")
    file = orchard.configuration.recipes_folder / "raspberry.yaml"
    before = file.read_text()
    page = person.go("/recipes/raspberry/edit")
    edit(page, "damage.growth_mm2_per_mm", "9999")
    page.locator("[name=reason]").fill("a slip")
    follow(page.get_by_role("button", name="Save as a draft"))
    expect(page.get_by_role("alert")).to_contain_text("growth_mm2_per_mm")
    assert page.locator('[name="v:damage.growth_mm2_per_mm"]').input_value() == "9999"
    assert file.read_text() == before


def test_a_form_sent_again_does_not_undo_what_another_has_changed_meanwhile(orchard: Any, panel: Any) -> None:
    person, name, field = panel("Quin"), "raspberry", "damage.growth_mm2_per_mm"
    editor = RecipeEditor(orchard.home, orchard.configuration.recipes_folder)
    file = orchard.configuration.recipes_folder / f"{name}.yaml"
    before = file.read_text()
    page = person.go(f"/recipes/{name}/edit")
    try:
        editor.edit(name, {field: 57.0}, Person("Rosa", "quality", "seen on the curves"))
        theirs = file.read_text()
        for typed in ("many", "58"):
            edit(page, field, typed)
            page.locator("[name=reason]").fill("a little softer")
            follow(page.get_by_role("button", name="Save as a draft"))
            expect(page.get_by_role("alert")).to_be_visible()
            assert page.locator(f'[name="v:{field}"]').input_value() == typed
        expect(page.get_by_role("alert")).to_contain_text("it was changed since")
        assert file.read_text() == theirs
        follow(page.get_by_role("link", name="Open the form with the present values"))
        assert page.locator(f'[name="v:{field}"]').input_value() == "57"
    finally:
        editor.revert(name, Person("Rosa", "quality", "as it was"))
    assert file.read_text() == before


def test_a_viewer_is_shown_recipes_and_may_not_change_them(orchard: Any, panel: Any) -> None:
    person = panel()
    page = person.go("/recipes/blueberry/edit")
    assert page.get_by_role("button", name="Save as a draft").count() == 0
    token = person.go("/people").locator("input[name=csrf]").first.get_attribute("value")
    form = {"csrf": token, "reason": "x", "base": "0" * 64, "v:damage.growth_mm2_per_mm": "50"}
    answer = person.context.request.post(f"{person.address}/recipes/blueberry/draft", form=form)
    assert answer.status == 403


def test_a_draft_is_tried_on_what_was_inspected(orchard: Any, panel: Any) -> None:
    page = panel("Quin").go("/recipes/strawberry")
    follow(page.get_by_role("button", name="What would it have decided?"))
    follow(page.get_by_role("link", name="Open whatif.html"))
    expect(page.frame_locator("iframe").get_by_text("What if: Strawberry").first).to_be_visible()


@pytest.mark.parametrize("decimal", [".", ","])
def test_a_form_sent_back_as_it_was_shown_changes_nothing(decimal: str) -> None:
    for recipe in load_recipes().values():
        values = recipe.model_dump(mode="json")
        form = {field.path: formatted(field, decimal) for group in groups(values) for field in group.fields}
        assert changed(values, form) == {}


def test_a_form_tells_numbers_lists_and_nothing_apart() -> None:
    values = load_recipes()["strawberry"].model_dump(mode="json")
    typed = {"steps.result_closings_mm": "3; 4,5", "steps.start_width_mm": "", "damage.area[0].area_mm2": " 99,5 "}
    assert changed(values, typed) == {"steps.result_closings_mm": [3, 4.5], "damage.area[0].area_mm2": 99.5}
    for path, text in (("damage.area[0].area_mm2", "nan"), ("steps.number", "many"), ("steps.start", "middle")):
        with pytest.raises(BadFieldError):
            changed(values, {path: text})


@given(st.lists(st.tuples(st.sampled_from(["pass", "fail"]), st.floats(0, 1e4)), max_size=40), st.floats(0, 1e4))
def test_a_strip_shows_every_fruit_on_its_side_of_the_limit(values: Any, limit: float) -> None:
    drawn = strip(values, [("limit", limit)])
    assert len(drawn.dots) == len(values)
    for (_, value), (_, x, _) in zip(values, drawn.dots, strict=True):
        assert (x - drawn.lines[0].x) * (value - limit) >= 0
