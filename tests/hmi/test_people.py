"""The people page in a real browser: roles, log-in, idle time."""

import re
import subprocess
import sys

import pytest

from tests.chromium import follow, next_document

UNKNOWN_ORDER = """() => {
  const form = Object.assign(document.createElement("form"), {method: "post", action: "/order"});
  const fields = {csrf: document.body.dataset.token, order: "explode"};
  form.append(...Object.entries(fields).map(([name, value]) => {
    return Object.assign(document.createElement("input"), {type: "hidden", name, value});
  }));
  document.body.append(form);
  form.submit();
}"""


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
    output = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert re.search(r"panel\.logged_in .* by Ana \(operator\)", output), output
    # Another process of the pages, with the shortest idle time: who touches nothing is a viewer again.
    address = free_hmi(people, STATION_HMI_IDLE_S="10")
    typist, refused, answered = panel(address), panel(address), panel(address)
    answered.log_in("admin", "482915")
    sent = []
    answered.page.on("request", lambda request: sent.append(request.url) if request.url.endswith("/order") else None)
    with next_document(answered.page):
        answered.page.evaluate(UNKNOWN_ORDER)
    answered.until("main", "The data sent is incomplete or invalid")
    for each in (typist, refused):
        each.log_in("admin", "482915")
        each.open("/maintenance/configuration")
    refused.page.locator("textarea").fill("modbus: [")
    follow(refused.page.get_by_role("button", name="Check and save"))
    typist.page.locator("textarea").press_sequentially("# half a")
    text = typist.page.locator("textarea").input_value()
    hasty = panel(address)
    hasty.log_in("Ana", "7391")
    hasty.until(".who", "Ana")
    hasty.until(".who", "Log in")
    assert "Ana" not in hasty.text(".who")
    answered.until(".who", "Log in")
    assert (answered.page.url, len(sent)) == (address + "/", 1), "the order was sent again"
    # Unless that would throw away what was typed.
    typist.until(".stale-line", "You were logged out. What you typed is still here")
    assert "# half a" in text
    assert typist.page.locator("textarea").input_value() == text
    assert typist.page.get_by_role("button", name="Check and save").is_disabled()
    typist.page.locator("textarea").fill(typist.page.locator("textarea").evaluate("each => each.defaultValue"))
    typist.until(".who", "Log in")
    refused.until(".stale-line", "You were logged out")
    assert refused.page.locator("textarea").input_value() == "modbus: ["


@pytest.mark.timeout(120)
def test_who_reads_on_by_the_wheel_is_there(operator, eventually):
    requested = []
    operator.page.on(
        "request", lambda request: requested.append(request.url) if request.url.endswith("/here") else None
    )
    operator.open("/")
    operator.page.mouse.move(600, 400)
    assert not requested
    eventually(lambda: operator.page.mouse.wheel(0, 50) or requested)


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
