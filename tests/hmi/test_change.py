"""The page Change fruit where the check with the ball is due, requested without a browser."""

import json
import re
from datetime import UTC, datetime, timedelta

import pytest

from station.channel.panel_run import (
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
    RecipeNames,
    Recipes,
    RecipeSummary,
)
from station.messages import calibration
from station.messages.message import verbatim
from station.settings.recipe import load_recipes
from tests.chromium import Finger, follow, press_long, tap

PRESSED = """() => {
  for (const name of ["click", "submit"]) {
    const note = (event) => (window.pressed ??= []).push(`${name} ${event.target.innerText}`);
    addEventListener(name, note, true);
  }
}"""
"""Has a page note what is pressed and sent on it."""
DUE = calibration.NEVER_VERIFIED(how=calibration.HOW_TO_VERIFY())


def state(check_due):
    order = OperatorCommandView(
        ticket=1, order=OperatorCommandName.CHOOSE_RECIPE, argument="2", state="done", why=None, who="Ana",
        began_utc_ms=1, ended_utc_ms=2,
    )  # fmt: skip
    recipe = RecipeNames(number=2, name="blueberry", title="Blueberry", revision="1")
    return PanelState.model_construct(  # pyrefly: ignore[missing-argument] (what the page reads)
        boot="1", utc_ms=1, state="idle", activity=verbatim(""), packml_state=None, mode=1, ready=not check_due,
        why_not_ready=check_due, busy=False, needs_person=False, stopping=False, simulated=False, recipe=recipe,
        check_due=check_due, alarms=(), devices=(), orders=(order,), may=(), recoveries=(),
    )  # fmt: skip


@pytest.mark.parametrize("path", ["/change/2", "/change/progress"])
def test_a_check_that_is_due_is_said_and_led_to_before_any_fruit(pages, monkeypatch, path):
    gateway, values = pages.context.gateway, json.dumps(load_recipes()["blueberry"].model_dump(mode="json"))
    chosen = RecipeSummary(number=2, name="blueberry", title="Blueberry", revision="1", values=values)

    async def answer(*_, **__):
        return Recipes(recipes=(chosen,), active=chosen, problems=())

    monkeypatch.setattr(gateway, "request", answer)
    for due in (DUE, None):
        gateway.state = state(due)
        status, _, body = pages("GET", path, headers={"accept-language": "de"})
        text = re.sub(r"\s+", " ", body.decode())
        assert status == 200
        assert ("Die Kalibrierung wurde nie überprüft" in text) == bool(due)
        assert ('href="/maintenance/sensor"' in text) == bool(due)


def test_the_ball_is_not_among_the_fruit(pages, monkeypatch):
    values = json.dumps(load_recipes()["blueberry"].model_dump(mode="json"))
    names = ("Blueberry", 2), (pages.context.ball_recipe, 100)
    found = tuple(RecipeSummary(number=n, name=name, title=name, revision="1", values=values) for name, n in names)

    async def answer(*_, **__):
        return Recipes(recipes=found, active=found[1], problems=())

    monkeypatch.setattr(pages.context.gateway, "request", answer)
    _, _, body = pages("GET", "/change")
    assert "/change/2" in body.decode()
    assert "/change/100" not in body.decode()


@pytest.mark.timeout(240)
def test_an_open_page_follows_a_change_that_another_made(ready, panel):
    shown = panel()
    shown.open("/change")
    shown.until(".fruit-tile.active", "Blueberry")
    other = panel()
    other.open("/change/3")
    other.until("table", "15 … 24|mm")
    ready.choose("raspberry")
    shown.until(".fruit-tile.active", "Raspberry")
    other.until("main", "this recipe is already active")


@pytest.mark.timeout(240)
def test_a_fruit_that_has_the_focus_keeps_it_while_the_page_is_renewed(ready, panel):
    shown = panel()
    shown.open("/change")
    renewed = lambda: shown.page.expect_response("**/change/part")  # noqa: E731
    with renewed():
        pass
    shown.page.locator("#fruit-3").focus()
    shown.page.evaluate("document.activeElement.isTheSame = true")
    for _ in range(3):  # the part is as it was before the next one is fetched
        with renewed():
            pass
    assert shown.page.evaluate("[document.activeElement.id, document.activeElement.isTheSame]") == ["fruit-3", True]
    ready.choose("raspberry")
    shown.until("#fruit-3.active", "Raspberry")
    assert shown.page.evaluate("document.activeElement.id") == "fruit-3", "where the part is made anew, by its id"


@pytest.mark.timeout(240)
def test_a_change_that_is_done_before_its_answer_arrives_ends_on_its_progress_and_not_where_it_began(ready, operator):
    operator.open("/change/3")
    routes = []
    operator.page.route("**/change", lambda route: routes.append(route))  # noqa: PLW0108 (it is marked as seen)
    operator.page.get_by_role("button", name="Change to Raspberry").click(no_wait_after=True)
    while not routes:
        operator.page.wait_for_timeout(20)  # the browser's events are taken meanwhile
    answer = routes[0].fetch(max_redirects=0)
    ready.until(lambda state: state.recipe.number == 3)
    for _ in range(2):  # the second one after what the first one did
        with operator.page.expect_response(re.compile(r"/change/3(/part)?$")):
            pass
    routes[0].fulfill(response=answer)
    operator.until("main", "The station is ready")
    assert operator.page.url.endswith("/change/progress")


@pytest.mark.timeout(240)
def test_a_page_of_another_state_is_loaded_anew_but_not_under_a_finger(ready, operator):
    def polled(ms):
        with operator.page.expect_response("**/part"):
            clock.run_for(ms)

    clock, mouse = operator.page.clock, operator.page.mouse
    clock.install()
    clock.pause_at(datetime.now(UTC) + timedelta(minutes=1))
    operator.page.route("**/part", lambda route: route.fulfill(body="", headers={"x-state": "another"}))
    operator.open("/change/3")
    clock.run_for(500)
    operator.page.get_by_role("button", name="Change to Raspberry").hover()
    mouse.down()
    polled(500)
    polled(1000)  # after what the one before did
    operator.page.locator("body:not(.stale)").wait_for()  # as it became by this clock alone
    mouse.up()
    operator.page.wait_for_url("**/change/progress")
    ready.until(lambda state: state.recipe.number == 3)
    operator.open("/change/2")
    with operator.page.expect_event("load"):
        polled(1000)
    operator.page.locator("h1").hover()
    mouse.down()
    with operator.page.expect_event("load"):
        for _ in range(3):  # a glove that lies there
            polled(1000)
    mouse.up()


@pytest.mark.timeout(240)
def test_the_second_contact_of_a_touch_confirms_nothing_on_the_page_that_it_opened(ready, operator, eventually):
    def touch():
        finger.down(*point)
        finger.up()

    page, clock, finger = operator.page, operator.page.clock, Finger(operator.page)
    clock.install()
    clock.pause_at(datetime.now(UTC) + timedelta(minutes=1))
    operator.open("/change/1")
    button = page.get_by_role("button", name="Change to Strawberry")
    box = button.bounding_box()
    operator.open("/change")
    tile = page.locator("#fruit-1").bounding_box()
    point = (tile["x"] + tile["width"] / 2, (box["y"] + tile["y"] + tile["height"]) / 2)
    clock.run_for(500)
    touch()
    page.wait_for_url("**/change/1")
    assert button.bounding_box() == box
    page.evaluate(PRESSED)
    touch()
    assert eventually(lambda: page.evaluate("window.pressed")) == ["click Change to Strawberry"]
    press_long(button)
    assert page.evaluate("window.pressed") == ["click Change to Strawberry"], "nor one that stays"
    clock.run_for(500)
    touch()
    page.wait_for_url("**/change/progress")
    ready.until(lambda state: state.recipe.number == 1)


@pytest.mark.timeout(240)
def test_a_stop_is_pressed_also_by_a_touch_as_early_as_a_second_contact(ready, operator):
    page, clock = operator.page, operator.page.clock
    clock.install()
    clock.pause_at(datetime.now(UTC) + timedelta(minutes=1))
    operator.open("/change/1")
    button = page.get_by_role("button", name="Change to Strawberry")
    button.evaluate("button => (button.dataset.stop = '')")  # as on the jog's
    tap(button)
    page.wait_for_url("**/change/progress")
    ready.until(lambda state: state.recipe.number == 1)


@pytest.mark.timeout(240)
def test_the_fruit_is_changed_while_a_fruit_is_running(ready, operator):
    operator.open("/change")
    touches = 0
    follow(operator.page.locator(".fruit-tile", has_text="Raspberry"))
    touches += 1
    operator.page.get_by_role("heading", name="Change to Raspberry").wait_for()
    assert "Width of the fruit" in operator.text("table")
    sequence = ready.begin()
    follow(operator.page.get_by_role("button", name="Change to Raspberry"))
    touches += 1
    operator.until("main", "In progress|Done")
    outcome = ready.end(sequence)
    assert outcome.recipe_number == 2, "the fruit under way is judged by the recipe that it began with"
    operator.until("main", "The station is ready")
    assert touches <= 3
    assert "Raspberry" in operator.text(".progress")
    state = ready.until(lambda state: state.recipe.number == 3)
    assert (state.orders[0].state, state.orders[0].who) == ("done", "Ana")
    ready.twin(do="fruit", kind="raspberry", seed=1, bruised=False)
    assert ready.end(ready.begin()).recipe_number == 3
