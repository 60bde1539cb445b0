"""The page Set-up: each step decided from the station's state, what it waits for, and who sees it."""

import html
import re
from typing import Any

import pytest

from hmi.setup.steps import steps
from hmi.web.roles import Role
from hmi.web.translation import Locale
from station.channel.panel_run import DeviceView, FruitSummary, PanelState, Recent, RecipeNames, SetupView
from station.messages import calibration, readiness
from station.messages.message import Message, verbatim
from tests.hmi.test_security import log_in

PATH = "/maintenance/setup"
AWAY = verbatim("no controller answers at 10.0.0.9; check its cable")
SUMMARY = calibration.SUMMARY_MEASURED(calibration="20261123T120000Z", scale_mm=0.0267, percent=2.0)
STRAWBERRY = RecipeNames(number=1, name="strawberry", title="Strawberry", revision="1")
BALL = RecipeNames(number=100, name="rubber_ball", title="Rubber ball", revision="1")
FRESH_SETUP = SetupView(
    addresses={"gripper": "10.0.0.9:63352", "arm": "10.0.0.9", "camera": "DIGIT D20966", "plc": "0.0.0.0:502"},
    poses_taught=False, joints_rad=(0.1, -1.5, 1.6, -1.7, -1.5708, 0.0), width_mm=1.4, calibration=None, zero_mm=None,
    has_reference=False, ball_recipe="rubber_ball",
)  # fmt: skip
DONE_SETUP = FRESH_SETUP.model_copy(
    update={"poses_taught": True, "calibration": SUMMARY, "zero_mm": 0.12, "has_reference": True}
)


def state(setup=FRESH_SETUP, fault: Message | None = AWAY, recipe=None, devices=("camera", "gripper", "arm"), **more):
    """A fresh station; nothing answers."""
    values: dict[str, Any] = {
        "boot": "1", "utc_ms": 1, "state": "idle", "activity": verbatim(""), "packml_state": None, "mode": 1,
        "ready": False, "why_not_ready": readiness.NOT_PRODUCTION(), "busy": False, "needs_person": False,
        "stopping": False, "simulated": False, "recipe": recipe, "check_due": None, "alarms": (), "orders": (),
        "devices": tuple(DeviceView(name=name, fault=fault, age_s=None) for name in devices), "may": (),
        "recoveries": (), "plc_connected": False, "plc_alive": False, "line_trouble": None, "last_sequence": None,
        "running_sequence": None, "fruit_changes": 0,
        "setup": setup,
    }  # fmt: skip
    return PanelState.model_construct(**(values | more))


def fruit(area_mm2: float | None = 60.0, recipe="strawberry"):
    return FruitSummary(
        sequence=7, outcome="NO_RESULT", reasons=(), ended_utc_ms=1, duration_ms=1, recipe=recipe, lot="",
        area_mm2=area_mm2, closing_mm=None, areas_mm2=(),
    )  # fmt: skip


def found(setup=FRESH_SETUP, recent=(), **more):
    return {step.name: step.state for step in steps(state(setup, **more), Recent(fruit=recent))}


def test_on_a_fresh_station_the_devices_come_one_by_one_and_the_rest_waits():
    assert found() == {
        "gripper": "next", "arm": "open", "camera": "open", "plc": "open", "poses": "open", "zero": "blocked",
        "calibration": "blocked", "reference": "blocked", "recipe": "open", "first": "blocked",
    }  # fmt: skip
    waits = {step.name: step.waits_for for step in steps(state(), Recent(fruit=()))}
    assert waits["calibration"] == ("gripper", "camera")
    assert waits["first"] == ("gripper", "arm", "camera", "plc", "poses", "calibration", "recipe")


def test_a_device_that_answers_is_done_and_what_waited_for_it_can_be_done():
    assert found(fault=None) | {"first": ""} == {
        "gripper": "done", "arm": "done", "camera": "done", "plc": "next", "poses": "open", "zero": "open",
        "calibration": "open", "reference": "blocked", "recipe": "open", "first": "",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("connected", "alive", "trouble", "done"),
    [(False, False, None, False), (True, False, None, False), (True, True, None, True), (True, True, AWAY, False)],
)
def test_the_plc_is_there_once_it_is_connected_and_its_heartbeat_moves(connected, alive, trouble, done):
    states = found(plc_connected=connected, plc_alive=alive, line_trouble=trouble)
    assert (states["plc"] == "done") is done


def test_a_calibration_counts_once_the_check_that_the_site_requires_has_passed():
    due = calibration.NEVER_VERIFIED(how=calibration.HOW_TO_VERIFY())
    assert found(DONE_SETUP, fault=None, check_due=due)["calibration"] != "done"
    assert found(DONE_SETUP, fault=None)["calibration"] == "done"


def test_the_ball_is_no_fruit_and_a_fruit_that_was_not_measured_is_not_the_first():
    assert found(recipe=BALL)["recipe"] == "open"
    assert found(recipe=STRAWBERRY)["recipe"] == "done"
    assert found(recent=(fruit(recipe="rubber_ball"), fruit(area_mm2=None)))["first"] == "blocked"
    assert found(recent=(fruit(),))["first"] == "done"


def test_a_bench_without_an_arm_has_no_steps_for_one():
    assert not {"arm", "poses"} & set(found(devices=("camera", "gripper")))


def shown(pages, language="en", **values):
    recent = values.pop("recent", ())
    pages.context.gateway.state, pages.context.gateway.recent = state(**values), Recent(fruit=recent)
    status, _, body = pages("GET", PATH, headers={"accept-language": language})
    assert status == 200
    return html.unescape(body.decode())


def step_of(page, name):
    return re.findall(rf'data-step="{name}">(.*?)</li>', page, re.DOTALL)[0]


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", ("0 of 10 steps are done", "Next", "Waits for: Gripper, Camera", "Joint positions now")),
        ("de", ("0 von 10 Schritten sind erledigt", "Als Nächstes", "Wartet auf: Greifer, Kamera", "Gelenkstellungen")),
        ("es", ("0 de 10 pasos hechos", "Siguiente", "Espera a: Pinza, Cámara", "Posiciones de las articulaciones")),
    ],
)
def test_each_step_has_the_stations_message_its_address_and_where_it_is_done(pages, language, words):
    log_in(pages)
    page = shown(pages, language)
    assert [word for word in words if word not in page] == []
    gripper = step_of(page, "gripper")
    assert all(word in gripper for word in (str(AWAY), "10.0.0.9:63352", 'href="/maintenance/configuration"'))
    assert "[0.1, -1.5, 1.6, -1.7, -1.5708, 0.0]" in step_of(page, "poses"), "as the configuration takes them"
    assert "href" not in step_of(page, "calibration"), "nothing leads to what cannot be done yet"


def test_while_the_zero_is_set_the_width_is_live_and_then_the_calibrations_finding(pages):
    log_in(pages)
    assert "1.4 mm" in step_of(shown(pages, fault=None), "zero")
    assert "off by 0.12 mm" in step_of(shown(pages, fault=None, setup=DONE_SETUP), "zero")


def test_the_last_step_says_why_the_station_takes_no_fruit_and_then_leads_to_it(pages):
    log_in(pages)
    ready = {"fault": None, "setup": DONE_SETUP, "recipe": STRAWBERRY, "plc_connected": True, "plc_alive": True}
    assert str(readiness.NOT_PRODUCTION()) in step_of(shown(pages, **ready), "first")
    page = shown(pages, **ready, recent=(fruit(),))
    assert "The set-up is complete" in page
    assert 'href="/history/7"' in step_of(page, "first")


@pytest.mark.parametrize("role", [Role.VIEWER, Role.OPERATOR, Role.QUALITY, Role.MAINTENANCE])
def test_only_who_may_edit_the_configuration_sees_it(pages, role):
    if role is not Role.VIEWER:
        log_in(pages, "Ana", role)
    pages.context.gateway.state = state()
    assert pages("GET", PATH)[0] == 403
    part = pages.context.live.part("setup.steps", Locale("en"), role)
    assert "10.0.0.9" not in part.html


@pytest.mark.parametrize(("role", "link"), [(Role.ADMIN, True), (Role.OPERATOR, False)])
def test_on_a_fresh_installation_the_run_page_says_that_the_set_up_is_not_finished(pages, role, link):
    log_in(pages, "Ana", role)
    for last, is_shown in ((None, True), (7, False)):
        pages.context.gateway.state = state(last_sequence=last)
        part = pages.context.live.part("run.fruit", Locale("en"), role).html
        assert ("The set-up of this station is not finished" in part) is is_shown
        assert (f'href="{PATH}"' in part) is (is_shown and link)
