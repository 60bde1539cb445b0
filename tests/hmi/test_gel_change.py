"""Button by which a technician notes a change of the gel, on the page of the sensor."""

import pytest

from hmi.web.roles import Role
from station.channel.panel_maintenance import CalibrationState, NoteGelChange
from station.channel.panel_run import GetRecipes, Recipes
from station.messages.calibration import GEL_CHANGED, NONE
from station.messages.maintenance import BUSY

BUTTON = 'action="/maintenance/sensor/gel-changed"'
NOTED = "The change of the gel is noted. Calibrate the new gel with the ball."
CHANGED = GEL_CHANGED(at="2026-11-29 10:15 UTC", operator="Max")
STATE = CalibrationState(
    serial="D20966", in_use=NONE(scale_mm=0.0266), calibration=None, verification=None, age_s=None,
    verification_age_s=None, oldest_days=90, verify_every_h=None, trouble=None, ball_mm=24, run=None, run_refused=None,
    gel_change_refused=None,
)  # fmt: skip


class Sensor:
    """The pages for a person of the role maintenance, over a sensor's state."""

    def __init__(self, pages):
        self.pages, self.state, self.requested = pages, STATE, []
        pages.cookies["station_session_8080"] = pages.context.sessions.log_in("Max", Role.MAINTENANCE)

    async def answer(self, request, *_, **__):
        self.requested.append(request)
        return Recipes(recipes=(), active=None, problems=()) if isinstance(request, GetRecipes) else self.state

    def page(self, path="/maintenance/sensor"):
        status, _, body = self.pages("GET", path)
        assert status == 200
        return body.decode()


@pytest.fixture
def sensor(pages, monkeypatch):
    made = Sensor(pages)
    monkeypatch.setattr(pages.context.gateway, "request", made.answer)
    return made


def test_a_technician_notes_a_changed_gel_and_reads_what_comes_next(sensor):
    assert BUTTON in sensor.page()
    status, headers, _ = sensor.pages.post("/maintenance/sensor/gel-changed", csrf=sensor.pages.token())
    assert status == 303
    [noted] = [each for each in sensor.requested if isinstance(each, NoteGelChange)]
    assert (noted.actor.who, noted.actor.role) == ("Max", "maintenance")
    assert NOTED in sensor.page(headers["location"])
    sensor.state = STATE.model_copy(update={"trouble": CHANGED})
    page = sensor.page(headers["location"])
    assert "gel was changed (2026-11-29 10:15 UTC, Max): calibrate it" in page
    assert NOTED not in page


def test_no_button_is_shown_where_the_order_is_refused_or_to_a_viewer(sensor):
    sensor.state = STATE.model_copy(update={"gel_change_refused": BUSY()})
    assert BUTTON not in sensor.page()
    sensor.state = STATE
    sensor.pages.cookies.clear()
    assert BUTTON not in sensor.page()
