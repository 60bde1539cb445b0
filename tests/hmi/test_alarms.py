"""The alarms page in a real browser."""

import re
import time

import pytest

from hmi.web.gateway import STALE_S
from hmi.web.roles import Role
from station.channel.line import CommandDone
from station.channel.panel import ListedAlarm
from station.channel.panel_run import PanelState
from station.inspection.alarm_table import ALARMS, AlarmId
from tests.chromium import Finger, follow, next_document, settle
from tests.hmi.test_security import log_in
from tests.slower_mode import SLOWER_MODE


def become(gateway, since_ms):
    row = ALARMS[AlarmId.CAMERA_LOST]
    alarm = ListedAlarm(
        alarm="camera_lost", number=row.number, priority="high", state="unacknowledged", active=True, latched=False,
        detail=None, since_utc_ms=since_ms, raised=1, cause=row.cause, consequence=row.consequence,
        action=row.action, document="", shelved_until_utc_ms=None, shelved_by="",
    )  # fmt: skip
    gateway.state = PanelState.model_construct(  # pyrefly: ignore[missing-argument]
        utc_ms=since_ms, alarms=(alarm,), state="idle", ready=True, busy=False, why_not_ready=None,
        packml_state=None, recipe=None, simulated=False,
    )  # fmt: skip
    gateway.heard_s = time.monotonic()


PUSHED = """
window.EventSource = class extends EventSource {
  set onmessage(take) {
    super.onmessage = (event) => {
      window.push = (changes) => take({data: JSON.stringify({...JSON.parse(event.data), parts: {}, ...changes})});
      push({});
    };
  }
};
"""
"""Has the test say what changes on a page, beside the station's own events that nothing does."""


@pytest.mark.timeout(120)
@pytest.mark.parametrize("meanwhile", ["an alarm", "a restart of the pages"])
def test_what_a_finger_touched_is_what_it_presses_whatever_came_meanwhile(cell, panel, eventually, meanwhile):
    def link_to(path):
        return {"parts": {"alarms.not_normal": [path, f'<a class="button main" href="{path}">Details</a>']}}

    shown = panel()
    shown.page.add_init_script(PUSHED)
    shown.open("/alarms")
    eventually(lambda: shown.page.evaluate("'push' in window"))
    shown.page.evaluate("changes => push(changes)", link_to("/lot"))
    link = shown.page.get_by_role("link", name="Details")
    box, finger = link.bounding_box(), Finger(shown.page)
    settle(shown.page)
    with next_document(shown.page):
        finger.down(box["x"] + 30, box["y"] + 30)
        changes = link_to("/history") if meanwhile == "an alarm" else {"boot": "another"}
        shown.page.evaluate("changes => push(changes)", changes)
        for _ in range(2):  # a page that loads itself anew is gone by then
            shown.page.evaluate("fetch('/alarms').then((answer) => answer.text())")
        finger.up()
    assert shown.page.url.endswith("/lot")


@pytest.mark.parametrize("path", ["/alarms", "/alarms/camera_lost"])
def test_what_was_raised_after_the_page_was_shown_is_not_acknowledged_by_it(pages, monkeypatch, path):
    sent = []

    async def request(order, _reply, **_):
        sent.append(order)
        return CommandDone(done=True, why=None)

    def acknowledge():
        form = page.partition('action="/alarms/camera_lost/acknowledge"')[2].partition("</form>")[0]
        fields = dict(re.findall('name="([^"]+)" value="([^"]*)"', form))
        return pages.post("/alarms/camera_lost/acknowledge", **{**fields, "csrf": pages.token()})[0]

    monkeypatch.setattr(pages.context.gateway, "request", request)
    log_in(pages, "Ana", Role.OPERATOR)
    become(pages.context.gateway, 1_790_000_000_000)
    page = pages("GET", path)[2].decode()
    become(pages.context.gateway, 1_790_000_600_000)
    assert (acknowledge(), sent) == (409, [])
    page = pages("GET", path)[2].decode()
    assert (acknowledge(), len(sent)) == (303, 1)


def test_an_alarm_of_a_station_that_does_not_answer_is_not_renewed_as_if_it_were_live(pages):
    gateway = pages.context.gateway
    become(gateway, 1_790_000_000_000)
    assert pages("GET", "/alarms/camera_lost/part")[0] == 200
    gateway.heard_s -= STALE_S + 1
    assert pages("GET", "/alarms/camera_lost/part")[0] == 503


@pytest.mark.timeout(240)
def test_the_life_of_an_alarm(ready, operator, panel, eventually):
    def life():
        rows = operator.page.locator(".log tbody tr", has_text="camera sends no frames").all_inner_texts()
        return [re.findall("raised|shown again|shelved|returned to normal|acknowledged", row)[0] for row in rows][::-1]

    operator.open("/alarms/history")
    earlier = len(life())
    ready.twin(do="set", device="camera", fault="off")
    try:
        operator.open("/alarms")
        operator.until(".alarm-line", "tactile camera sends no frames")
        alarm = operator.page.locator(".alarm", has_text="tactile camera sends no frames")
        assert "not acknowledged" in alarm.inner_text()
        reader = panel()
        reader.open("/alarms/camera_lost")
        assert "not acknowledged" in reader.text("article")
        follow(alarm.get_by_role("button", name="Acknowledge"))
        alarm.filter(has_text="acknowledged · since").wait_for()
        reader.until("article", r"P\d, \w+ · acknowledged · since")
        ready.until(lambda state: [a.state for a in state.alarms if a.alarm == "camera_lost"] == ["acknowledged"])
        follow(operator.page.locator(".alarm", has_text="camera").get_by_role("link", name="Details"))
        assert "Check the camera's cable" in operator.text("article")
        assert "Triggers are refused" in operator.text("article")
        for width, height in ((390, 844), (1280, 800)):
            operator.page.set_viewport_size({"width": width, "height": height})
            assert operator.overflow() <= 0
        operator.page.locator("input[name=for_s][value='3600']").check(force=True)
        operator.hold(".shelve-form [data-hold]")
        operator.until("h2", "Shelved")
        assert "by Ana" in operator.text("main")
        assert "camera" not in operator.text(".alarm-line")
        follow(operator.page.get_by_role("button", name="Show again"))
        operator.until(".alarm-line", "camera")
        operator.open("/maintenance/image")
        operator.until("main", "The camera sends no images: this is the last one.")
        assert operator.page.locator(".live img.old").is_visible()
        operator.open("/alarms")
    finally:
        ready.twin(do="clear", device="camera")
        ready.twin(**SLOWER_MODE)  # as the other tests of the station have it
    alarm.filter(has_text="returned to normal, not acknowledged").wait_for()
    follow(alarm.get_by_role("button", name="Acknowledge"))
    ready.until(lambda state: not any(a.alarm == "camera_lost" for a in state.alarms))
    reader.until("h1", "Alarms")  # it is over: the page of it has nothing to show
    follow(operator.page.locator("main").get_by_role("link", name="History"))

    def history():  # which is written behind
        operator.page.reload()
        changes = life()[earlier:]
        first = ["raised", "acknowledged", "shelved", "shown again"]
        return changes[:4] == first and sorted(changes[4:]) == ["acknowledged", "returned to normal"]

    eventually(history)
