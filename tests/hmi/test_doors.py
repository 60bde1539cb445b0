"""Silent, slow and greedy clients at the pages' door: others are served, and a person's *Stop* is carried out."""

import contextlib
import http.client
import re
import resource
import socket
import ssl
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlencode, urlsplit

import psutil
import pytest

from station.inspection.alarm_table import AlarmId
from tests.hmi.conftest import OPERATOR, OPERATOR_PIN, PATIENCE_S, Cell

CROWD = 250
STRANGER, NEIGHBOUR = "127.0.0.9", "127.0.0.1"
"""An address of its own, and the panel's."""
MOST_BYTES = 16_000_000
"""Bytes; each of a thousand connections had up to 0.4 MB."""
HEADER = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"
BODY = b"POST /language HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 900\r\n\r\ncsrf="
STREAM = b"GET /live?part=frame.state HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


class Visitor:
    """A browser that makes a new connection for each request, as one does behind a closed door."""

    def __init__(self, address: str, context: ssl.SSLContext | None = None) -> None:
        self._url, self._context, self._cookie = urlsplit(address), context, ""

    def request(self, method: str, path: str, **form: str) -> tuple[int, str]:
        host, port = str(self._url.hostname), self._url.port or 0
        if self._context is None:
            line = http.client.HTTPConnection(host, port, timeout=PATIENCE_S)
        else:
            line = http.client.HTTPSConnection(host, port, timeout=PATIENCE_S, context=self._context)
        headers = {"Cookie": self._cookie, "Content-Type": "application/x-www-form-urlencoded"}
        with contextlib.closing(line):
            line.request(method, path, urlencode(form), headers)
            answer = line.getresponse()
            if cookie := answer.headers["set-cookie"]:
                self._cookie = cookie.partition(";")[0]
            return answer.status, answer.read().decode()

    def post(self, path: str, **form: str) -> int:
        token = re.search(r'data-token="([^"]+)"', self.request("GET", "/people")[1])
        assert token is not None
        return self.request("POST", path, csrf=token[1], **form)[0]

    def log_in(self) -> None:
        assert self.post("/people/log-in", name=OPERATOR, pin=OPERATOR_PIN) == 303


@pytest.fixture
def crowd() -> Iterator[Callable[..., list[socket.socket]]]:
    """Clients that send something and then nothing more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, 4096)), hard))
    with contextlib.ExitStack() as stack:

        def come(
            address: str, count: int, source: str, sent: bytes = b"", context: ssl.SSLContext | None = None
        ) -> list[Any]:
            clients = []
            for _ in range(count):
                place = ("127.0.0.1", urlsplit(address).port or 0)
                client = socket.create_connection(place, PATIENCE_S, (source, 0))
                stack.callback(client.close)
                with contextlib.suppress(OSError):  # it may be put out again by now
                    if context is not None:
                        client = context.wrap_socket(client, server_hostname="127.0.0.1")
                        stack.callback(client.close)
                    client.sendall(sent)
                clients.append(client)
            return clients

        yield come
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def stop_and_start(cell: Cell, person: Visitor) -> None:
    """A person's *Stop* is carried out, then *Start*."""
    assert person.post("/order", order="stop") == 303
    cell.until(lambda state: state.stopping)
    assert person.post("/order", order="start") == 303
    cell.until(lambda state: not state.stopping)


def flood_of(cell: Cell) -> object:
    """The address that the alarm names; None without an alarm."""
    state = cell.state()
    alarms = () if state is None else state.alarms
    details = [alarm.detail for alarm in alarms if alarm.alarm == AlarmId.CONNECTION_FLOOD]
    return details[0].parameters["address"] if details and details[0] else None


def serving(port: int | None) -> psutil.Process:
    """The process that serves a port; the cell's are no children of ours."""
    listening = [one for one in psutil.net_connections("tcp") if one.status == psutil.CONN_LISTEN]
    return psutil.Process(next(one.pid for one in listening if one.laddr and one.laddr.port == port))


@pytest.mark.timeout(240)
@pytest.mark.parametrize(
    ("sent", "source"),
    [(b"", STRANGER), (b"", NEIGHBOUR), (HEADER, STRANGER), (BODY, NEIGHBOUR)],
    ids=["silent", "silent beside the panel", "half a header", "half a body beside the panel"],
)
def test_clients_that_never_ask_close_the_pages_to_nobody(people, eventually, crowd, source, sent):
    person, viewer, process = Visitor(people.address), Visitor(people.address), people.process("hmi")
    person.log_in()
    files = process.num_fds()
    crowd(people.address, CROWD, source, sent)
    eventually(lambda: process.num_fds() < files + 80)  # those of an address, and not its crowd: streams have no end
    assert viewer.request("GET", "/")[0] == 200
    assert viewer.request("GET", "/api/openapi.json")[0] == 200
    stop_and_start(people, person)
    eventually(lambda: flood_of(people) in {STRANGER, NEIGHBOUR})  # the detail is of when the alarm was raised
    eventually(lambda: process.num_fds() <= files + 8, 30)
    stop_and_start(people, person)


@pytest.mark.timeout(240)
@pytest.mark.parametrize("shaken", [False, True], ids=["no handshake", "handshake alone"])
def test_clients_of_tls_that_never_ask_close_the_pages_to_nobody(
    people, eventually, crowd, free_hmi, certificate, shaken
):
    address = free_hmi(people, **certificate)
    trusting = ssl.create_default_context(cafile=certificate["STATION_HMI_TLS_CERTIFICATE"])
    person, viewer = Visitor(address, trusting), Visitor(address, trusting)
    person.log_in()
    process = serving(urlsplit(address).port)
    memory = process.memory_info().rss
    clients = crowd(address, CROWD, STRANGER, context=trusting if shaken else None)
    assert viewer.request("GET", "/")[0] == 200
    stop_and_start(people, person)

    def ended():
        for client in clients:
            client.settimeout(0.01)
            try:
                if client.recv(1):
                    return False
            except TimeoutError:
                return False
            except OSError:
                continue  # reset
        return True

    eventually(ended, 30)
    stop_and_start(people, person)
    for _ in range(3):  # of the address whose alarm the other tests know: it may still be raised in the next one
        for client in crowd(address, CROWD, STRANGER, context=trusting if shaken else None):
            client.close()
    eventually(lambda: process.memory_info().rss < memory + MOST_BYTES, 10)


@pytest.mark.timeout(240)
@pytest.mark.parametrize("source", [STRANGER, NEIGHBOUR])
def test_a_thousand_event_streams_take_no_panels(people, eventually, crowd, source):
    person, process = Visitor(people.address), people.process("hmi")
    person.log_in()
    files = process.num_fds()
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(crowd, people.address, 1000, source, STREAM)
        while not coming.done():
            assert Visitor(people.address).request("GET", "/people")[0] == 200
        coming.result()
    eventually(lambda: process.num_fds() < files + 80)  # those of an address, and not its crowd: streams have no end
    assert Visitor(people.address).request("GET", "/")[0] == 200
    panel = crowd(people.address, 1, NEIGHBOUR, STREAM)[0]
    panel.settimeout(PATIENCE_S)
    got = b""
    while got.count(b"data: ") <= 2:  # it goes on
        received = panel.recv(65_536)
        assert received, "the panel's stream was ended"
        got += received
    stop_and_start(people, person)
