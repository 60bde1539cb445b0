"""Security of the pages, without a browser: forged, replayed, oversized and cross-site requests are refused."""

import asyncio
import json
import re
import stat
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmi.past.past import PanelBusyError
from hmi.past.worker import HOLDER
from hmi.web.app import make_app, make_context
from hmi.web.gateway import UNNAMED_BURST, UNNAMED_REFILL_S, Gateway
from hmi.web.login_limiter import FREE_TRIES, LONGEST_WAIT_S, LoginRateLimiter
from hmi.web.navigation import modules
from hmi.web.roles import Right, Role
from hmi.web.security import LARGEST_BODY_BYTES, SAFE_METHODS
from hmi.web.sessions import TOKEN_LIFE_S, Sessions
from hmi.web.user_store import FILE_NAME, UserStore, UserStoreError, pin_problem
from station.settings.configuration import load_configuration
from tests.hmi.conftest import Pages

PIN, OTHER_PIN = "482915", "730264"


class Clock:
    def __init__(self):
        self.now_s = 1000.0

    def __call__(self):
        return self.now_s


def log_in(pages, name="admin", role=Role.ADMIN):
    session = pages.context.sessions.log_in(name, role)
    pages.cookies["station_session_8080"] = session
    return session


class TestRequests:
    @pytest.mark.parametrize("path", ["/", "/people", "/alarms"])
    def test_every_answer_has_a_strict_policy(self, pages, path):
        status, headers, body = pages("GET", path)
        assert status == 200
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"
        text = body.decode()
        assert "<script>" not in text
        assert " style=" not in text
        assert " onclick" not in text
        assert 'src="http' not in text

    HOSTS = (
        *("127.0.0.1:80@evil", "127.0.0.1:", "127.0.0.1:80:80", "evil@127.0.0.1"),
        *("[127.0.0.1]x", "[127.0.0.1]", "127.0.0.1 "),
    )

    @pytest.mark.parametrize(
        "host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "", "[::2]", *HOSTS]
    )
    def test_another_hosts_name_is_refused(self, pages, host):
        status, headers, _ = pages("GET", "/", headers={"host": host})
        assert status == 421
        assert "default-src 'none'" in headers["content-security-policy"], "what is refused is no way around it"

    @pytest.mark.parametrize("after", [":80@evil", "@evil", ":80:80", ":8080x", "]", ":808080", "\t"])
    def test_our_name_with_more_behind_it_is_another(self, pages, after):
        assert pages("GET", "/", headers={"host": "127.0.0.1" + after})[0] == 421

    @pytest.mark.parametrize(
        "headers",
        [
            {"origin": "http://evil.example"},
            {"origin": "null"},
            {"origin": "https://127.0.0.1:8080"},
            {"origin": "http://127.0.0.1:9999"},
            {"sec-fetch-site": "cross-site"},
            {"sec-fetch-site": "same-site"},
        ],
    )
    def test_a_foreign_pages_order_is_refused(self, pages, headers):
        log_in(pages)
        body = f"csrf={pages.token()}&language=de".encode()
        kind = {"content-type": "application/x-www-form-urlencoded"}
        assert pages("POST", "/language", body, headers={**kind, **headers})[0] == 403
        assert pages("POST", "/language", body, headers=kind)[0] == 303

    def test_an_order_without_a_token_or_with_a_forged_one_is_refused(self, pages):
        token = pages.token()
        for forged in ("", "x", token[:-1] + ("0" if token[-1] != "0" else "1"), "9" + token):
            status, _, body = pages.post("/language", csrf=forged, language="de")
            assert status == 403, forged
            assert b"was not sent from a page of this browser" in body

    def test_every_route_that_changes_something_asks_for_a_token(self, pages):
        """The cookie alone orders nothing. `/here` only restarts the idle time; the API has its own tests."""
        log_in(pages)
        routes = [route for module in modules() for route in module.router.routes if route.methods - SAFE_METHODS]
        paths = [route.path for route in routes if not route.path.startswith("/api/") and route.path != "/here"]
        assert len(paths) > 30
        for path in paths:
            assert pages.post(re.sub(r"{\w+}", "1", path))[0] == 403, path

    def test_an_order_that_was_sent_before_is_refused(self, pages):
        token = pages.token()
        assert pages.post("/language", csrf=token, language="de")[0] == 303
        assert pages.post("/language", csrf=token, language="es")[0] == 409
        assert pages.cookies["station_language_8080"] == "de"

    def test_another_browsers_token_is_worth_nothing(self, pages):
        token = pages.token()
        pages.cookies.clear()
        pages.token()
        assert pages.post("/language", csrf=token, language="de")[0] == 403

    @pytest.mark.parametrize("chunks", [1, 4])
    def test_a_request_that_is_too_large_is_refused(self, pages, chunks):
        body = b"csrf=" + b"x" * (LARGEST_BODY_BYTES + 1)
        kind = {"content-type": "application/x-www-form-urlencoded"}
        assert pages("POST", "/language", body, headers=kind)[0] == 413
        kind["content-length"] = ""
        assert pages("POST", "/language", body, headers=kind, chunks=chunks)[0] == 413

    def test_what_is_too_large_is_not_taken_to_its_end(self, pages):
        kind = {"content-type": "application/x-www-form-urlencoded", "content-length": ""}
        assert pages("POST", "/language", b"x" * (2 * LARGEST_BODY_BYTES), headers=kind, chunks=8)[0] == 413
        assert pages.unread >= 3

    def test_a_form_that_is_not_what_is_expected_is_refused(self, pages):
        log_in(pages)
        assert pages.post("/change", csrf=pages.token(), number="70000")[0] == 400
        assert pages.post("/order", csrf=pages.token(), order="explode")[0] == 400
        assert pages("GET", "/fruit/0")[0] == 400
        assert pages("GET", "/live?part=secret")[0] == 404
        assert pages("GET", "/nowhere")[0] == 404

    @pytest.mark.parametrize(
        "back", ["//evil.example", "/\\evil.example", "https://evil.example", "javascript:x", "/\t/evil.example"]
    )
    def test_nobody_is_sent_to_a_foreign_page(self, pages, back):
        _, headers, _ = pages.post("/language", csrf=pages.token(), language="de", back=back)
        assert headers["location"] == "/"

    def test_what_a_station_that_is_away_makes_of_an_order_is_said(self, pages):
        log_in(pages)
        status, _, body = pages.post("/order", csrf=pages.token(), order="stop")
        assert status == 503
        assert b"did not answer in time" in body

    def test_a_page_says_that_the_station_has_not_answered(self, pages):
        text = pages("GET", "/")[2].decode()
        assert '<body class="stale"' in text
        assert "The station does not answer" in text


class TestLogIn:
    def test_the_first_start_asks_for_an_administrator_and_only_once(self, pages):
        assert b"First start" in pages("GET", "/people")[2]
        wrong = pages.post("/people/begin", csrf=pages.token(), name="admin", pin=PIN, again=OTHER_PIN)
        assert (wrong[0], pages.context.people.first_start) == (400, True)
        simple = pages.post("/people/begin", csrf=pages.token(), name="admin", pin="123456", again="123456")
        assert (simple[0], pages.context.people.first_start) == (400, True)
        before = pages.cookies["station_session_8080"]
        assert pages.post("/people/begin", csrf=pages.token(), name="admin", pin=PIN, again=PIN)[0] == 303
        assert pages.cookies["station_session_8080"] != before, "a cookie from before the log-in is worth nothing"
        again = pages.post("/people/begin", csrf=pages.token(), name="eve", pin=OTHER_PIN, again=OTHER_PIN)
        assert again[0] == 400
        assert list(pages.context.people.names()) == ["admin"]

    def test_the_first_start_keeps_the_name_that_was_typed(self, pages):
        body = pages.post("/people/begin", csrf=pages.token(), name="Maria", pin=PIN, again=OTHER_PIN)[2]
        assert b'autocomplete="off" value="Maria"' in body
        body = pages.post("/people/begin", csrf=pages.token(), name="Maria", pin="123456", again="123456")[2]
        assert b'autocomplete="off" value="Maria"' in body

    def test_what_is_wrong_with_a_new_person_is_said_at_their_form_which_keeps_its_texts(self, pages):
        pages.context.people.begin("admin", PIN)
        log_in(pages)
        status, _, body = pages.post("/people/put", csrf=pages.token(), name="Maria", role="quality", pin="12")
        own, others = body.decode().split('<section class="card stack">')[1:]
        assert (status, "A PIN has" in own, "<details open" in own) == (400, False, False)
        form = others.partition("<details open>")[2]
        assert "A PIN has 6 to 12 digits" in form
        assert '<input name="name" value="Maria"' in form
        assert '<option value="quality" selected>' in form
        body = pages.post("/people/remove", csrf=pages.token(), name="admin")[2].decode()
        own, others = body.split("<h2>People</h2>")
        assert ("one administrator" in own, "one administrator" in others) == (False, True)

    def test_who_logs_in_after_a_wrong_pin_comes_to_a_page(self, pages):
        pages.context.people.begin("admin", PIN)
        body = pages.post("/people/log-in", csrf=pages.token(), name="admin", pin=OTHER_PIN, back="/change/3")[2]
        back = body.decode().partition('class="button quiet" href="/people?back=')[2].partition('"')[0]
        _, headers, _ = pages.post("/people/log-in", csrf=pages.token(), name="admin", pin=PIN, back=back)
        assert pages("GET", headers["location"])[0] == 200

    def test_the_first_start_is_at_the_station_itself(self, pages):
        pages.client_address = "192.0.2.7"
        assert b"/people/begin" not in pages("GET", "/people")[2]
        assert pages.post("/people/begin", csrf=pages.token(), name="eve", pin=PIN, again=PIN)[0] == 403
        assert pages.context.people.first_start

    def test_the_station_itself_is_there_also_by_the_address_of_its_network_card(self, pages, card_address):
        pages.client_address = card_address
        assert pages.post("/people/begin", csrf=pages.token(), name="admin", pin=PIN, again=PIN)[0] == 303

    def test_who_is_logged_in_may_not_try_pins_without_end_either(self, pages):
        pages.context.people.begin("admin", PIN)
        log_in(pages)
        for _ in range(FREE_TRIES + 1):
            assert pages.post("/people/own-pin", csrf=pages.token(), old=OTHER_PIN, pin=OTHER_PIN)[0] == 403
        assert pages.post("/people/own-pin", csrf=pages.token(), old=PIN, pin=OTHER_PIN)[0] == 429
        assert pages.context.people.check("admin", PIN) is Role.ADMIN

    @pytest.mark.parametrize(("path", "field"), [("/people/log-in", "pin"), ("/people/own-pin", "old")])
    def test_every_refused_pin_is_in_the_audit_trail(self, pages, monkeypatch, path, field):
        noted = []

        async def request(_, what, *__, **___):
            noted.append((what.what, what.person.who, what.subject))

        monkeypatch.setattr(Gateway, "request", request)
        pages.context.people.begin("admin", PIN)
        log_in(pages)
        fields = {"name": "admin", "pin": PIN, field: OTHER_PIN}
        assert pages.post(path, csrf=pages.token(), **fields)[0] == 403
        assert noted == [("log_in_refused", "admin", "127.0.0.1")]

    def test_a_request_for_the_records_counts_for_the_person_or_the_address(self, pages, monkeypatch):
        """So that a greedy one waits for its own."""
        holders = []

        async def read():
            holders.append(HOLDER.get())
            raise PanelBusyError("full")

        monkeypatch.setattr(pages.context.past.recipes, "read", read)
        pages.client_address = "192.0.2.7"
        for path in ("/recipes", "/recipes/strawberry/chart"):
            assert pages("GET", path)[0] == 409
        log_in(pages, "Ana", Role.OPERATOR)
        for path in ("/recipes", "/api/v1/recipes"):
            assert pages("GET", path)[0] == 409
        assert holders == ["192.0.2.7", "192.0.2.7", "person Ana", "person Ana"]

    def test_two_stations_on_one_machine_log_nobody_out_of_the_other(self, pages, tmp_path):
        """A browser's cookies are a host's, with any port."""
        home = tmp_path / "second"
        home.mkdir()
        site = load_configuration(None, {"STATION_HOME": str(home), "STATION_HMI_PORT": "8081"})
        context = make_context(site, None, "")
        second = Pages(make_app(context), context, pages.cookies)
        for each in (pages, second):
            each.context.people.begin("admin", PIN)
            assert each.post("/people/log-in", csrf=each.token(), name="admin", pin=PIN)[0] == 303
        for each in (pages, second):
            assert each.post("/people/put", csrf=each.token(), name="Ana", role="operator", pin="7391")[0] == 303
            assert each.post("/language", csrf=each.token(), language="de")[0] == 303
        assert second.post("/language", csrf=second.token(), language="es")[0] == 303
        assert [b'<html lang="de"' in each("GET", "/")[2] for each in (pages, second)] == [True, False]

    def test_wrong_pins_have_to_wait(self, pages):
        pages.context.people.begin("admin", PIN)
        for _ in range(FREE_TRIES + 1):
            assert pages.post("/people/log-in", csrf=pages.token(), name="admin", pin=OTHER_PIN)[0] == 403
        status, _, body = pages.post("/people/log-in", csrf=pages.token(), name="admin", pin=PIN)
        assert status == 429
        assert b"Too many wrong PINs" in body
        assert pages.context.sessions.caller(pages.cookies["station_session_8080"]).role is Role.VIEWER

    def test_a_cookie_is_out_of_reach_of_scripts_and_other_pages(self, pages):
        pages.context.people.begin("admin", PIN)
        _, headers, _ = pages.post("/people/log-in", csrf=pages.token(), name="admin", pin=PIN, back="//evil.example")
        assert headers["location"] == "/"
        assert {"HttpOnly", "SameSite=lax", "Path=/"} <= {part.strip() for part in headers["set-cookie"].split(";")}

    def test_a_removed_person_is_logged_out_everywhere(self, pages):
        pages.context.people.begin("admin", PIN)
        pages.context.people.put("Ana", Role.OPERATOR, "7391")
        hers = pages.context.sessions.log_in("Ana", Role.OPERATOR)
        log_in(pages)
        assert pages.post("/people/remove", csrf=pages.token(), name="Ana")[0] == 303
        assert pages.context.sessions.caller(hers).role is Role.VIEWER

    @pytest.mark.parametrize(
        ("path", "fields"),
        [
            ("/people/log-in", {"name": "Ana", "pin": "7391"}),
            ("/people/own-pin", {"old": "7391", "pin": "8402"}),
        ],
    )
    def test_who_is_removed_while_a_pin_of_hers_is_checked_is_gone(self, pages, monkeypatch, path, fields):
        people, sessions = pages.context.people, pages.context.sessions
        people.begin("admin", PIN)
        people.put("Ana", Role.OPERATOR, "7391")
        checked, go_on, check = threading.Event(), threading.Event(), UserStore.check

        def blocked(store, name, pin):
            role = check(store, name, pin)
            checked.set()
            assert go_on.wait(60)
            return role

        def form(name, role):
            log_in(pages, name, role)
            return dict(pages.cookies), pages.token()

        (hers, token), (admins, admin_token) = form("Ana", Role.OPERATOR), form("admin", Role.ADMIN)
        monkeypatch.setattr(UserStore, "check", blocked)
        monkeypatch.setattr("tests.hmi.conftest.run_apart", lambda work: work)  # both in the loop of this test

        async def scenario():
            waiting = asyncio.Event()

            class Watched(asyncio.Lock):
                async def acquire(self):
                    if self.locked():
                        waiting.set()
                    return await super().acquire()

            monkeypatch.setattr("hmi.people.routes._CHECKING", Watched())
            pages.cookies = hers
            coming = asyncio.create_task(pages.post(path, csrf=token, **fields))
            await asyncio.to_thread(checked.wait, 60)
            pages.cookies = admins
            removed = asyncio.create_task(pages.post("/people/remove", csrf=admin_token, name="Ana"))
            turn = asyncio.create_task(waiting.wait())
            await asyncio.wait({removed, turn}, return_when=asyncio.FIRST_COMPLETED)
            go_on.set()
            turn.cancel()
            return (await coming)[1]["set-cookie"], (await removed)[0]

        cookie, status = asyncio.run(scenario())
        assert status == 303
        assert list(people.names()) == ["admin"]
        assert sessions.caller(cookie.partition(";")[0].partition("=")[2]).role is Role.VIEWER

    def test_a_changed_pin_or_role_ends_ones_other_sessions(self, pages):
        pages.context.people.begin("admin", PIN)
        pages.context.people.put("Ana", Role.OPERATOR, "7391")
        sessions = pages.context.sessions
        other, own = sessions.log_in("Ana", Role.OPERATOR), log_in(pages, "Ana", Role.OPERATOR)
        assert pages.post("/people/own-pin", csrf=pages.token(), old="0000", pin="8402")[0] == 403
        assert sessions.caller(other).name == "Ana", "a wrong PIN ends no session"
        assert pages.post("/people/own-pin", csrf=pages.token(), old="7391", pin="8402")[0] == 303
        assert {sessions.caller(session).role for session in (other, own)} == {Role.VIEWER}
        here = pages.cookies["station_session_8080"]
        assert sessions.caller(here).name == "Ana", "who has changed it stays logged in here"
        log_in(pages)
        assert pages.post("/people/put", csrf=pages.token(), name="Ana", role="quality", pin=OTHER_PIN)[0] == 303
        assert sessions.caller(here).role is Role.VIEWER

    def test_an_administrator_that_makes_himself_operator_is_one_everywhere(self, pages):
        pages.context.people.begin("admin", PIN)
        pages.context.people.put("Bea", Role.ADMIN, OTHER_PIN)
        elsewhere = pages.context.sessions.log_in("Bea", Role.ADMIN)
        log_in(pages, "Bea", Role.ADMIN)
        assert pages.post("/people/put", csrf=pages.token(), name="Bea", role="operator", pin="7391")[0] == 303
        assert pages.post("/people/put", csrf=pages.token(), name="Eve", role="admin", pin=PIN)[0] == 403
        assert pages.context.sessions.caller(pages.cookies["station_session_8080"]).role is Role.OPERATOR
        assert pages.context.sessions.caller(elsewhere).role is Role.VIEWER

    def test_audit_rows_of_anybody_are_limited_and_those_left_out_are_counted(self, pages, monkeypatch):
        noted = []

        async def request(_, what, *__, **___):
            noted.append(what)

        monkeypatch.setattr(Gateway, "request", request)
        for _ in range(UNNAMED_BURST + 20):
            assert pages.post("/people/clean", csrf=pages.token())[0] == 204
        assert len(noted) == UNNAMED_BURST
        log_in(pages)
        assert pages.post("/people/clean", csrf=pages.token())[0] == 204
        assert noted[-1].person.who == "admin", "a person's are not"
        pages.cookies.clear()
        later_s = time.monotonic() + UNNAMED_REFILL_S + 1
        monkeypatch.setattr("hmi.web.gateway.time.monotonic", lambda: later_s)
        assert pages.post("/people/clean", csrf=pages.token())[0] == 204
        assert "20 rows before it left out" in noted[-1].subject
        assert pages.post("/people/clean", csrf=pages.token())[0] == 204
        assert len(noted) == UNNAMED_BURST + 2

    def test_names_from_outside_are_shown_as_text(self, pages):
        name = "<img src=x onerror=alert(1)>"
        pages.context.people.begin(name, PIN)
        text = pages("GET", "/people")[2].decode()
        assert "<img src=x" not in text
        assert "&lt;img src=x" in text


class TestSessions:
    def test_who_is_idle_is_a_viewer_again(self):
        clock = Clock()
        sessions = Sessions(60.0, clock)
        session = sessions.log_in("Ana", Role.OPERATOR)
        clock.now_s += 50
        sessions.touch(session)
        clock.now_s += 50
        assert sessions.caller(session).may(Right.RUN)
        assert sessions.sweep() == []
        clock.now_s += 11
        assert sessions.caller(session).role is Role.VIEWER
        sessions.touch(session)
        assert sessions.caller(session).role is Role.VIEWER, "a touch after the time does not bring the person back"
        assert [caller.name for caller in sessions.sweep()] == ["Ana"]
        assert sessions.sweep() == []

    def test_a_page_whose_polls_fail_keeps_nobody_logged_in(self, pages, monkeypatch):
        clock, sessions = Clock(), pages.context.sessions
        monkeypatch.setattr(sessions, "_clock", clock)
        session = log_in(pages, "Ana", Role.OPERATOR)
        for _ in range(3):
            clock.now_s += 0.4 * pages.context.settings.idle_s
            assert pages("GET", "/alarms/camera_lost/part")[0] == 503
        assert sessions.caller(session).role is Role.VIEWER

    def test_an_old_token_is_refused(self):
        clock = Clock()
        sessions = Sessions(60.0, clock)
        token = sessions.token("a")
        clock.now_s += TOKEN_LIFE_S + 2
        assert sessions.spend("a", token) == "problem.old"

    @given(st.text(max_size=80))
    def test_no_text_is_a_token(self, text):
        assert Sessions(60.0).spend("a", text) == "problem.forged"


class TestPinLimit:
    def test_waits_grow_and_end(self):
        clock = Clock()
        limit = LoginRateLimiter(clock)
        waits = []
        for _ in range(40):
            limit.tried("name", "10.0.0.1")
            waits.append(limit.wait_s("name", "10.0.0.2"))
            clock.now_s += waits[-1]
        assert waits[:FREE_TRIES] == [0.0] * FREE_TRIES
        assert waits == sorted(waits)
        assert waits[-1] == LONGEST_WAIT_S
        limit.right("name", "10.0.0.1")
        assert limit.wait_s("name", "10.0.0.3") == 0.0

    def test_an_address_that_tries_many_names_waits_too(self):
        limit = LoginRateLimiter(Clock())
        for number in range(FREE_TRIES + 1):
            limit.tried(f"name {number}", "10.0.0.1")
        assert limit.wait_s("name 99", "10.0.0.1") > 0
        assert limit.wait_s("name 1", "10.0.0.2") == 0.0


class TestWrongPins:
    def log_in(self, pages, address, pin="7391", name="Ana"):
        pages.cookies.clear()
        pages.client_address = address
        return pages.post("/people/log-in", csrf=pages.token(), name=name, pin=pin)[0]

    @pytest.fixture
    def ana(self, pages):
        pages.context.people.begin("admin", PIN)
        pages.context.people.put("Ana", Role.OPERATOR, "7391")
        return pages

    def test_from_elsewhere_they_slow_the_person_but_not_at_her_own_panel_or_the_stations_screen(self, ana):
        assert self.log_in(ana, "10.0.0.1") == 303
        tried = [self.log_in(ana, f"10.0.9.{number}", "0000") for number in range(FREE_TRIES + 3)]
        assert tried == [403] * (FREE_TRIES + 1) + [429] * 2
        assert self.log_in(ana, "10.0.0.2") == 429, "who comes from an address that is not known waits"
        assert self.log_in(ana, "10.0.0.1") == 303
        assert self.log_in(ana, "127.0.0.1") == 303

    @pytest.mark.parametrize("address", ["10.0.0.1", "127.0.0.1", "10.0.0.9"])
    def test_each_address_is_slowed_itself(self, ana, address):
        if address != "10.0.0.9":
            assert self.log_in(ana, address) == 303
        tried = [self.log_in(ana, address, "0000") for _ in range(FREE_TRIES + 3)]
        assert tried == [403] * (FREE_TRIES + 1) + [429] * 2

    def test_a_known_panel_is_slowed_for_the_names_that_it_does_not_know(self, ana):
        assert self.log_in(ana, "10.0.0.1") == 303
        tried = [self.log_in(ana, "10.0.0.1", "000000", "admin") for _ in range(FREE_TRIES + 2)]
        assert tried[-1] == 429
        assert self.log_in(ana, "10.0.0.1") == 303


class TestPeopleFile:
    def test_it_is_the_stations_alone_and_holds_no_pin(self, tmp_path):
        people = UserStore(tmp_path / "hmi")
        people.begin("admin", PIN)
        path = tmp_path / "hmi" / FILE_NAME
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        text = path.read_text()
        assert PIN not in text
        assert "$argon2id$" in text
        again = UserStore(tmp_path / "hmi")
        assert again.check("admin", PIN) is Role.ADMIN
        assert again.check("admin", OTHER_PIN) is None
        assert again.check("nobody", "000000") is None

    def test_a_write_that_fails_leaves_what_was(self, tmp_path, monkeypatch):
        people = UserStore(tmp_path)
        people.begin("admin", PIN)
        before = people.path.read_bytes()

        def full(_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("station.atomic_file.os.fsync", full)
        with pytest.raises(UserStoreError, match="No space left"):
            people.put("Ana", Role.OPERATOR, "7391")
        assert people.path.read_bytes() == before
        assert list(people.names()) == ["admin"]

    def test_a_broken_file_is_no_first_start(self, tmp_path):
        (tmp_path / FILE_NAME).write_text('{"version": 1, "people": {"admin": {"role": "admin"}}}')
        people = UserStore(tmp_path)
        assert not people.first_start
        assert FILE_NAME in people.broken
        with pytest.raises(UserStoreError):
            people.begin("eve", PIN)
        assert "admin" in json.loads((tmp_path / FILE_NAME).read_text())["people"]

    def test_one_administrator_stays(self, tmp_path):
        people = UserStore(tmp_path)
        people.begin("admin", PIN)
        people.put("Ana", Role.OPERATOR, "7391")
        for wrong in (lambda: people.remove("admin"), lambda: people.put("admin", Role.OPERATOR, "")):
            with pytest.raises(UserStoreError, match="last_admin"):
                wrong()
        with pytest.raises(UserStoreError, match="pin_length"):
            people.put("Ana", Role.ADMIN, "")
        people.put("Ana", Role.ADMIN, OTHER_PIN)
        people.remove("admin")
        assert people.names() == {"Ana": Role.ADMIN}

    @pytest.mark.parametrize(
        ("pin", "wrong"),
        [
            ("7391", "people.pin_length"),
            ("123456", "people.pin_simple"),
            ("654321", "people.pin_simple"),
            ("000000", "people.pin_simple"),
            ("48291x", "people.pin_length"),
            ("٤٨٢٩١٥", "people.pin_length"),
            ("4829154829154", "people.pin_length"),
            (PIN, ""),
        ],
    )
    def test_a_pin_is_long_enough_and_not_simple(self, pin, wrong):
        assert pin_problem(pin, Role.QUALITY) == wrong
