"""The alarms page in a real browser."""

import re

import pytest

from tests.chromium import follow
from tests.slower_mode import SLOWER_MODE


@pytest.mark.timeout(240)
def test_the_life_of_an_alarm(ready, operator, eventually):
    def life():
        rows = operator.page.locator(".log tbody tr", has_text="camera gives no frames").all_inner_texts()
        return [re.findall("raised|shown again|shelved|returned to normal|acknowledged", row)[0] for row in rows][::-1]

    operator.open("/alarms/history")
    earlier = len(life())
    ready.twin(do="set", device="camera", fault="off")
    try:
        operator.open("/alarms")
        operator.until(".alarm-line", "tactile camera gives no frames")
        alarm = operator.page.locator(".alarm", has_text="tactile camera gives no frames")
        assert "not acknowledged" in alarm.inner_text()
        follow(alarm.get_by_role("button", name="Acknowledge"))
        alarm.filter(has_text="acknowledged · since").wait_for()
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
    follow(operator.page.locator("main").get_by_role("link", name="History"))

    def history():  # which is written behind
        operator.page.reload()
        changes = life()[earlier:]
        first = ["raised", "acknowledged", "shelved", "shown again"]
        return changes[:4] == first and sorted(changes[4:]) == ["acknowledged", "returned to normal"]

    eventually(history)
