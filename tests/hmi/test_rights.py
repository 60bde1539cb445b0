"""Rights of each role: every order and every restricted page, as docs/hmi.md promises."""

import re
from pathlib import Path

import pytest

from hmi.past.past import PanelBusyError
from hmi.web.navigation import modules
from hmi.web.roles import RIGHTS, Right, Role
from hmi.web.security import SAFE_METHODS

ROOT = Path(__file__).resolve().parents[2]
PIN = "482915"
OPERATING = {Right.RUN, Right.CHANGE_FRUIT, Right.HANDLE_ALARMS}
DOCUMENTED = {
    Role.VIEWER: set(),
    Role.OPERATOR: OPERATING,
    Role.QUALITY: OPERATING | {Right.EDIT_RECIPES, Right.APPROVE_RECIPES},
    Role.MAINTENANCE: OPERATING | {Right.MAINTAIN},
    Role.ADMIN: OPERATING
    | {Right.EDIT_RECIPES, Right.APPROVE_RECIPES, Right.MAINTAIN, Right.MANAGE_PEOPLE, Right.CONFIGURE},
}
"""The table of roles of docs/hmi.md, written out again: what the pages have of it may not be its own proof."""
ORDERS = {
    "/order": Right.RUN,
    "/change": Right.CHANGE_FRUIT,
    "/recipes/{name}/draft": Right.EDIT_RECIPES,
    "/recipes/{name}/submit": Right.EDIT_RECIPES,
    "/recipes/{name}/revert": Right.EDIT_RECIPES,
    "/recipes/{name}/whatif": Right.EDIT_RECIPES,
    "/recipes/import": Right.EDIT_RECIPES,
    "/recipes/{name}/approve": Right.APPROVE_RECIPES,
    "/recipes/{name}/reject": Right.APPROVE_RECIPES,
    "/alarms/{alarm}/acknowledge": Right.HANDLE_ALARMS,
    "/alarms/{alarm}/shelve": Right.HANDLE_ALARMS,
    "/alarms/{alarm}/unshelve": Right.HANDLE_ALARMS,
    "/maintenance/mode": Right.MAINTAIN,
    "/maintenance/jog": Right.MAINTAIN,
    "/maintenance/leds": Right.MAINTAIN,
    "/maintenance/sensor/begin": Right.MAINTAIN,
    "/maintenance/sensor/go-on": Right.MAINTAIN,
    "/maintenance/sensor/end": Right.MAINTAIN,
    "/maintenance/sensor/gel-changed": Right.MAINTAIN,
    "/maintenance/configuration": Right.CONFIGURE,
    "/maintenance/configuration/former": Right.CONFIGURE,
    "/people/put": Right.MANAGE_PEOPLE,
    "/people/remove": Right.MANAGE_PEOPLE,
}
"""The right that each order needs."""
LOGGED_IN = {
    "/history/export": {"form": "csv"},
    "/history/report": {"lot": "LOT 1"},
    "/jobs/{job}/end": {},
    "/people/own-pin": {"old": PIN, "pin": PIN},
}
"""What needs a log-in in any role, with the fields without which the form would be refused before."""
OPEN = {"/here", "/language", "/people/begin", "/people/log-in", "/people/log-out", "/people/clean"}
"""What a browser may send with no person logged in."""
RESTRICTED = {
    "/maintenance/support.zip": Right.MAINTAIN,
    "/maintenance/configuration": Right.CONFIGURE,
    "/maintenance/setup": Right.CONFIGURE,
}
"""What is not for every reader."""
JOB = "0" * 32
FILES = [f"/jobs/{JOB}/{what}/inspections.html" for what in ("file", "show", "document")]


@pytest.fixture
def as_role(pages, monkeypatch):
    """The pages for a person of a role; for the viewer none is logged in. Records and jobs are busy, as it were."""

    async def busy(*_):
        raise PanelBusyError("full")

    def full(*_):
        raise PanelBusyError("full")

    monkeypatch.setattr(pages.context.past.recipes, "read", busy)
    monkeypatch.setattr(pages.context.past, "support_bundle", busy)
    monkeypatch.setattr(pages.context.jobs, "begin", full)

    def become(role):
        pages.cookies.clear()
        if role is not Role.VIEWER:
            pages.cookies["station_session_8080"] = pages.context.sessions.log_in("Ana", role)
        return pages

    return become


def filled(path):
    return path.replace("{name}", "strawberry").replace("{alarm}", "camera_lost").replace("{job}", JOB)


def test_every_role_may_do_what_is_documented_and_no_more():
    assert RIGHTS == DOCUMENTED
    documented = (ROOT / "docs" / "hmi.md").read_text().split("| role | may |")[1].split("\n\n")[0]
    roles = re.findall(r"^\| (\w+) \|", documented, re.MULTILINE)
    assert roles == ["viewer", "operator", "quality", "maintenance", "administrator"]


def test_it_is_known_of_every_order_who_may_give_it():
    routes = [route for module in modules() for route in module.router.routes if route.methods - SAFE_METHODS]
    paths = [route.path for route in routes if not route.path.startswith("/api/")]  # the API has its own tests
    assert sorted(paths) == sorted([*ORDERS, *LOGGED_IN, *OPEN])


@pytest.mark.parametrize("path", ORDERS)
def test_an_order_is_refused_to_every_role_without_its_right(as_role, path):
    """A role that has the right gets an answer about the form, or about the station, which is away here."""
    for role in Role:
        pages = as_role(role)
        status = pages.post(filled(path), csrf=pages.token())[0]
        assert (status == 403) == (ORDERS[path] not in DOCUMENTED[role]), (role, status)


@pytest.mark.parametrize("path", LOGGED_IN)
def test_an_order_for_whoever_is_logged_in_is_refused_to_nobody_else(as_role, path):
    for role in Role:
        pages = as_role(role)
        if pages.context.people.first_start:
            pages.context.people.begin("Ana", PIN)
        status = pages.post(filled(path), csrf=pages.token(), **LOGGED_IN[path])[0]
        assert (status == 403) == (role is Role.VIEWER), (role, status)


@pytest.mark.parametrize("path", RESTRICTED)
def test_a_restricted_page_is_refused_to_every_role_without_its_right(as_role, path):
    for role in Role:
        status = as_role(role)("GET", path)[0]
        assert (status == 403) == (RESTRICTED[path] not in DOCUMENTED[role]), (role, status)


@pytest.mark.parametrize("path", FILES)
def test_the_files_of_a_job_are_for_whoever_is_logged_in(as_role, path):
    for role in Role:
        status = as_role(role)("GET", path)[0]
        assert (status == 403) == (role is Role.VIEWER), (role, status)
