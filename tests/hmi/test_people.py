"""The people page in a real browser: roles, log-in, idle time."""

import re
import subprocess
import sys

import pytest

from tests.chromium import follow


@pytest.mark.timeout(240)
def test_who_may_do_what_and_who_is_idle(people, panel, tmp_path, free_hmi):
    viewer = panel()
    viewer.open("/")
    operator = panel()
    operator.log_in("Ana", "7391", by_pad=True)
    assert operator.text(".who-name").split("\n") == ["Ana", "Operator"]
    operator.page.locator("form[action='/order']").first.wait_for()
    assert viewer.page.locator("form[action='/order']").count() == 0
    operator.open("/people")
    assert operator.page.locator("form[action='/people/put']").count() == 0
    tried = operator.page.evaluate(
        "fetch('/people/put', {method: 'POST', body: new URLSearchParams({name: 'Eve', role: 'admin', pin: '482916',"
        " csrf: document.body.dataset.token})}).then(answer => answer.status)"
    )
    assert tried == 403
    command = [sys.executable, "-m", "station", "audit", "show", "--config", str(people.file)]
    said = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert re.search(r"panel\.logged_in .* by Ana \(operator\)", said), said
    # Another process of the pages, with the shortest idle time: who touches nothing is a viewer again.
    hasty = panel(free_hmi(people, STATION_HMI_IDLE_S="10"))
    hasty.log_in("Ana", "7391")
    hasty.until(".who", "Ana")
    hasty.until(".who", "Log in")
    assert "Ana" not in hasty.text(".who")


@pytest.mark.timeout(120)
def test_a_link_from_another_site_logs_nobody_out(people, operator):
    elsewhere = operator.context.new_page()
    link = f"<a href='{people.address}/alarms'>Alarms</a>"
    elsewhere.route("http://elsewhere.example/", lambda route: route.fulfill(body=link, content_type="text/html"))
    elsewhere.goto("http://elsewhere.example/")
    follow(elsewhere.get_by_role("link", name="Alarms"))
    assert elsewhere.inner_text(".who-name").split("\n") == ["Ana", "Operator"]
    operator.open("/lot")
    assert operator.text(".who-name").split("\n") == ["Ana", "Operator"]
