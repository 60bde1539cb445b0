"""Attacks on the pages, the API, and metrics and health."""

import contextlib
import http.client
import sqlite3
import ssl
import time
from collections import Counter

from hmi.web.roles import RIGHTS, Right, Role
from station.records.database import FILE_NAME, records_folder

from .bystanders import HOST, PANEL, Browser
from .target import STRANGER, STRANGERS, Attack, Found, Target, crowd, silent, still_open

CROWD, STREAMS, GUESSES = 250, 1000, 60
HEADER = f"GET / HTTP/1.1\r\nHost: {HOST}\r\n".encode()
BODY = f"POST /language HTTP/1.1\r\nHost: {HOST}\r\nContent-Length: 900\r\n\r\ncsrf=".encode()
STREAM = f"GET /live?part=frame.state HTTP/1.1\r\nHost: {HOST}\r\n\r\n".encode()
PINS = {
    Role.OPERATOR: ("Ana", "7391"),
    Role.QUALITY: ("Bea", "482916"),
    Role.MAINTENANCE: ("Cem", "593827"),
    Role.ADMIN: ("admin", "482915"),
}
ORDERS = {
    Right.RUN: ("/order",),
    Right.CHANGE_FRUIT: ("/change",),
    Right.HANDLE_ALARMS: ("/alarms/no/acknowledge", "/alarms/no/shelve", "/alarms/no/unshelve"),
    Right.EDIT_RECIPES: ("/recipes/no/draft", "/recipes/no/submit", "/recipes/no/revert", "/recipes/import"),
    Right.APPROVE_RECIPES: ("/recipes/no/approve", "/recipes/no/reject"),
    Right.MAINTAIN: ("/maintenance/mode", "/maintenance/jog", "/maintenance/leds", "/maintenance/sensor/begin"),
    Right.MANAGE_PEOPLE: ("/people/put", "/people/remove"),
}
"""Without the fields that they need, so that who may gets 400 or 404 and nothing changes."""
MOST_ROWS = 60
"""Of the audit trail, of an attack without a login."""
FOREIGN = ("evil.example", f"{HOST}.evil.example", f"{HOST}:80@evil", "", "localhost.evil", f"[{HOST}]", f"evil/{HOST}")


def _trusting() -> ssl.SSLContext:
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def _counted(statuses: Counter[int]) -> str:
    return ", ".join(f"{count:,} x {status}" for status, count in sorted(statuses.items()))


def _only(statuses: Counter[int], *right: int) -> str:
    return "" if set(statuses) <= set(right) else f"wanted {' or '.join(map(str, right))} alone"


def silent_one(target: Target) -> Found:
    """One machine that connects and requests nothing."""
    return silent(target.port_of(target.pages), CROWD, (STRANGER,), target.seconds)


def silent_many(target: Target) -> Found:
    """The same from 250 addresses."""
    return silent(target.port_of(target.pages), CROWD, STRANGERS, target.seconds)


def silent_beside(target: Target) -> Found:
    """The same from the panel's own address."""
    return silent(target.port_of(target.pages), CROWD, (PANEL,), target.seconds)


def half_headers(target: Target) -> Found:
    """A header without its end."""
    return silent(target.port_of(target.pages), CROWD, (STRANGER,), target.seconds, HEADER)


def slow_bodies(target: Target) -> Found:
    """Forms whose body does not come."""
    return silent(target.port_of(target.pages), CROWD, STRANGERS, target.seconds, BODY)


def handshakes(target: Target) -> Found:
    """TLS handshakes without a request."""
    return silent(target.port_of(target.tls), CROWD, STRANGERS, target.seconds, context=_trusting())


def no_handshakes(target: Target) -> Found:
    """Connections to the port of TLS without a handshake."""
    return silent(target.port_of(target.tls), CROWD, STRANGERS, target.seconds)


def _streams(target: Target, sources: tuple[str, ...]) -> Found:
    with crowd(target.port_of(target.pages), STREAMS, sources, STREAM) as clients:
        at_start = still_open(clients)
        with crowd(target.port_of(target.pages), 1, (PANEL,), STREAM) as (panel,):
            panel.settimeout(3.0)
            until_s, got = time.monotonic() + max(3.0, target.seconds), b""
            with contextlib.suppress(OSError):
                while time.monotonic() < until_s:
                    got += panel.recv(65_536)
    events = got.count(b"data: ")
    seen = f"{at_start} open; events on the panel's stream: {events}"
    return Found(STREAMS, seen, "" if events > 1 else "the panel's stream does not go on")


def streams_one(target: Target) -> Found:
    """Event streams from one address."""
    return _streams(target, (STRANGER,))


def streams_beside(target: Target) -> Found:
    """Event streams from the panel's own address."""
    return _streams(target, (PANEL,))


def wrong_pins(target: Target) -> Found:
    """Wrong PINs for one person, from many addresses; then the person at the own panel."""
    name, pin = PINS[Role.OPERATOR]
    statuses = Counter(
        Browser(target.pages, source).post("/people/log-in", name=name, pin="0000") for source in STRANGERS[:GUESSES]
    )
    own = Browser(target.pages).post("/people/log-in", name=name, pin=pin)
    seen = f"{_counted(statuses)}; the person at the own panel then: {own}"
    return Found(GUESSES, seen, _only(statuses, 403, 429) or ("" if own == 303 else "the person is locked out"))


def _audit_rows(target: Target) -> int:
    with contextlib.closing(sqlite3.connect(records_folder(target.home) / FILE_NAME)) as database:
        return database.execute("SELECT count(*) FROM audit WHERE action NOT LIKE 'inspection.%'").fetchone()[0]


def clean_flood(target: Target) -> Found:
    """Orders that need no login, and leave a row in the audit trail."""
    before, statuses = _audit_rows(target), Counter[int]()
    visitor, until_s = Browser(target.pages, STRANGER), time.monotonic() + target.seconds
    while time.monotonic() < until_s:
        statuses[visitor.post("/people/clean")] += 1
    rows = _audit_rows(target) - before
    seen = f"{_counted(statuses)}; {rows} rows in the audit trail, the panel's own included"
    return Found(statuses.total(), seen, f"more than {MOST_ROWS} rows" if rows > MOST_ROWS else "")


def roles_and_orders(target: Target) -> Found:
    """Each order by each role."""
    wrong, tries = list[str](), 0
    for role in Role:
        person = Browser(target.pages)
        if role in PINS and person.post("/people/log-in", name=PINS[role][0], pin=PINS[role][1]) != 303:
            wrong.append(f"{role} cannot log in")
        for right, paths in ORDERS.items():
            for path in paths:
                tries += 1
                status = person.post(path)
                if (status == 403) == (right in RIGHTS[role]) or status < 400:
                    wrong.append(f"{role} {path}: {status}")
    return Found(tries, f"{len(wrong)} otherwise than documented", "; ".join(wrong))


def forged_forms(target: Target) -> Found:
    """An order of a logged-in person without a page's token, with a forged, another browser's or a used one."""
    name, pin = PINS[Role.OPERATOR]
    person, other = Browser(target.pages), Browser(target.pages, STRANGER)
    person.post("/people/log-in", name=name, pin=pin)
    used = person.token()
    kind = {"Content-Type": "application/x-www-form-urlencoded"}
    person.request("POST", "/order", f"csrf={used}&order=start", kind)
    bodies = ["order=stop", *(f"csrf={token}&order=stop" for token in ("", "x" * 40, other.token(), used))]
    statuses = Counter(person.request("POST", "/order", body, kind)[0] for body in bodies)
    for foreign in ({"Origin": "http://evil.example"}, {"Sec-Fetch-Site": "cross-site"}):
        statuses[person.request("POST", "/order", f"csrf={person.token()}&order=stop", {**kind, **foreign})[0]] += 1
    return Found(statuses.total(), _counted(statuses), _only(statuses, 400, 403, 409))


def forged_tokens(target: Target) -> Found:
    """API tokens that were never issued."""
    before, statuses = _audit_rows(target), Counter[int]()
    until_s, visitor = time.monotonic() + target.seconds, Browser(target.pages, STRANGER)
    while time.monotonic() < until_s:
        token = f"fst_{statuses.total():043d}"
        statuses[visitor.request("GET", "/api/v1/lots", headers={"Authorization": f"Bearer {token}"})[0]] += 1
    rows = _audit_rows(target) - before
    wrong = _only(statuses, 401) or (f"more than {MOST_ROWS} rows" if rows > MOST_ROWS else "")
    return Found(statuses.total(), f"{_counted(statuses)}; {rows} rows, the panel's own included", wrong)


def hostile_numbers(target: Target) -> Found:
    """Numbers and texts that JSON allows and a field does not."""
    token = {"Authorization": f"Bearer {target.token}", "Content-Type": "application/json"}
    bodies = ["1e999", "-1e999", "NaN", "[" * 5000, '"' + "x" * 100_000 + '"', "{}", '"\\u0000"', "null" * 9]
    visitor = Browser(target.pages, STRANGER)
    statuses = Counter(visitor.request("PUT", "/api/v1/lots/x", f'{{"grower":{body}}}', token)[0] for body in bodies)
    return Found(len(bodies), _counted(statuses), _only(statuses, 400, 413, 422))


def foreign_hosts(target: Target) -> Found:
    """Requests for another host's name."""
    visitor = Browser(target.pages, STRANGER)
    statuses: Counter[int] = Counter()
    for name in FOREIGN:
        with contextlib.suppress(http.client.HTTPException):
            statuses[visitor.request("GET", "/", headers={"Host": name})[0]] += 1
    return Found(len(FOREIGN), _counted(statuses), _only(statuses, 400, 421))


def large_bodies(target: Target) -> Found:
    """Bodies larger than any form."""
    ends: Counter[str] = Counter()
    visitor = Browser(target.pages, STRANGER)
    for size in (300_000, 10_000_000) * 5:
        try:
            ends[str(visitor.request("POST", "/language", b"x" * size)[0])] += 1
        except OSError:
            ends["closed"] += 1
    seen = ", ".join(f"{count} x {end}" for end, count in ends.items())
    return Found(ends.total(), seen, "" if set(ends) <= {"413", "closed"} else "wanted 413 or the end alone")


def silent_metrics(target: Target) -> Found:
    """Silent connections to metrics and health; a monitor at the machine itself sends requests meanwhile."""
    with crowd(target.metrics, CROWD, STRANGERS) as clients:
        most = still_open(clients)
        statuses: Counter[int] = Counter()
        until_s, monitor = time.monotonic() + target.seconds, Browser(f"http://127.0.0.1:{target.metrics}", "127.0.0.1")
        while time.monotonic() < until_s:
            statuses[monitor.request("GET", "/livez")[0]] += 1
            time.sleep(0.1)
        left = still_open(clients)
    return Found(CROWD, f"{most} open at first, {left} at the end; /livez: {_counted(statuses)}", _only(statuses, 200))


ATTACKS = (
    Attack("hmi", "250 silent connections from one address", silent_one),
    Attack("hmi", "250 silent connections from 250 addresses", silent_many),
    Attack("hmi", "250 silent connections from the panel's address", silent_beside),
    Attack("hmi", "250 half headers", half_headers),
    Attack("hmi", "250 slow bodies", slow_bodies),
    Attack("tls", "250 TLS handshakes without a request", handshakes),
    Attack("tls", "250 connections without a TLS handshake", no_handshakes),
    Attack("hmi", "1,000 event streams from one address", streams_one),
    Attack("hmi", "1,000 event streams from the panel's address", streams_beside),
    Attack("hmi", "wrong PINs from 60 addresses", wrong_pins),
    Attack("hmi", "`POST /people/clean` without a log-in", clean_flood),
    Attack("hmi", "roles x orders", roles_and_orders),
    Attack("hmi", "forged, foreign and used form tokens", forged_forms),
    Attack("hmi", "forged API tokens", forged_tokens),
    Attack("hmi", "hostile JSON, such as 1e999", hostile_numbers),
    Attack("hmi", "foreign `Host`", foreign_hosts),
    Attack("hmi", "bodies of 0.3 and 10 MB", large_bodies),
    Attack("service", "250 silent connections to metrics and health", silent_metrics),
)
