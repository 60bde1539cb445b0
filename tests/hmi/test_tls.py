"""The pages over TLS, with a certificate of their own."""

import http.client
import os
import ssl
import subprocess
import sys
import urllib.request

import pytest

from tests.chromium import follow


@pytest.mark.timeout(240)
def test_a_person_is_logged_in_over_tls_with_a_cookie_for_nothing_else(people, panel, free_hmi, certificate):
    address = free_hmi(people, **certificate)
    trusting = ssl.create_default_context(cafile=certificate["STATION_HMI_TLS_CERTIFICATE"])
    with urllib.request.urlopen(address, context=trusting, timeout=60) as answer:
        assert answer.status == 200
        assert int(answer.headers["strict-transport-security"].partition("=")[2]) >= 86_400
    browser = panel(address, ignore_https_errors=True)
    browser.log_in("Ana", "7391")
    browser.until(".who", "Ana")
    browser.page.locator("body:not(.stale)").wait_for()
    browser.open("/people")
    follow(browser.page.locator("button[name=language][value=es]"))
    cookies = {each["name"]: each for each in browser.context.cookies()}
    port = address.rpartition(":")[2]
    session, language = f"station_session_{port}", f"station_language_{port}"
    assert {session, language} <= set(cookies)
    for name, cookie in cookies.items():
        site = "Lax" if name == session else "Strict"
        assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, site), name
    plain = http.client.HTTPConnection("127.0.0.1", int(port), timeout=60)
    plain.request("GET", "/")
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        plain.getresponse()
    plain.close()


def test_a_certificate_that_is_none_is_said_in_one_sentence(tmp_path, certificate):
    (tmp_path / "station.crt").write_text("no certificate")
    variables = {**os.environ, **certificate, "STATION_HOME": str(tmp_path / "home")}
    command = [sys.executable, "-m", "station", "hmi"]
    ended = subprocess.run(command, env=variables, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert "hmi.tls" in ended.stderr
    assert "name a certificate and its key in PEM" in ended.stderr
    assert "Traceback" not in ended.stderr
