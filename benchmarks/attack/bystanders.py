"""Bystanders of an attack, as processes of their own: a Modbus client at a 10 ms scan, and a logged-in panel.

Run as `bystanders.py scan PORT` or `bystanders.py panel URL ENDPOINT NAME PIN`: goes on until its input ends, then
prints one line of JSON.
"""

import asyncio
import json
import re
import select
import socket
import ssl
import struct
import sys
import time
from collections.abc import Callable
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from urllib.parse import urlencode, urlsplit

from station.channel.client import ChannelClient
from station.channel.messages import ChannelError
from station.channel.panel_run import GetPanelState, PanelState

HOST, PLC, PANEL = "10.79.0.1", "10.79.0.2", "10.79.0.3"
"""The station's address in the attack's own network, and those of the two."""
SCAN_S, ANSWER_S = 0.01, 0.5
"""Period of the client, and its time-out."""
PAUSE_S, STOP_S = 0.3, 10.0
"""Of the panel: from one *Stop* to the next, and after which one counts as not carried out."""
REQUEST_REST = struct.pack(">HHBBHH", 0, 6, 1, 3, 100, 20)
REPLY_BYTES = 9 + 2 * 20
TOKEN = re.compile(r'data-token="([^"]+)"')


def repeat(once: Callable[[], None], period_s: float, enough: Callable[[], bool] = lambda: True) -> None:
    """Do something once a period until the input has ended and it is enough; a missed period is left out.

    It has started after the first time: a client then has the connection that an attack is not to take.
    """
    once()
    print("begun", flush=True)
    due_s = time.monotonic() + period_s
    while not (select.select([sys.stdin], [], [], max(0.0, due_s - time.monotonic()))[0] and enough()):
        once()
        due_s = max(due_s + period_s, time.monotonic())


def scan(port: int) -> dict[str, list[float] | int]:
    """Read 20 registers once a scan."""
    took_ms: list[float] = []
    errors, number = 0, 0
    client: socket.socket | None = None

    def once() -> None:
        nonlocal client, errors, number
        began_s, number = time.perf_counter(), (number + 1) % 65_536
        try:
            if client is None:
                client = socket.create_connection((HOST, port), ANSWER_S, (PLC, 0))
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.sendall(struct.pack(">H", number) + REQUEST_REST)
            reply = client.recv(REPLY_BYTES, socket.MSG_WAITALL)
            if len(reply) != REPLY_BYTES or reply[:2] != struct.pack(">H", number):
                raise ConnectionError("no whole reply")
        except OSError as error:
            if not errors:
                print(f"scan: {error!r} after {len(took_ms)} scans", file=sys.stderr)
            errors += 1
            if client is not None:
                client.close()
            client = None
        else:
            took_ms.append(1000 * (time.perf_counter() - began_s))

    repeat(once, SCAN_S)
    if client is not None:
        client.close()
    return {"took_ms": took_ms, "errors": errors}


class Browser:
    """A browser that makes a new connection for each request.

    Args:
        url: of the pages.
        source: address that it comes from.
    """

    def __init__(self, url: str, source: str = PANEL) -> None:
        self._url, self._source = urlsplit(url), (source, 0)
        self.cookie = ""

    def request(
        self, method: str, path: str, body: bytes | str | None = None, headers: dict[str, str] | None = None
    ) -> tuple[int, str]:
        """Return a response's status and body.

        Raises:
            OSError: no connection, or no response in time.
            HTTPException: no whole response.
        """
        host, port = str(self._url.hostname), self._url.port or 0
        if self._url.scheme == "https":
            context = ssl._create_unverified_context()  # noqa: SLF001 (the attack's own certificate)
            line = HTTPSConnection(host, port, timeout=STOP_S, source_address=self._source, context=context)
        else:
            line = HTTPConnection(host, port, timeout=STOP_S, source_address=self._source)
        try:
            line.request(method, path, body, {"Cookie": self.cookie, **(headers or {})})
            response = line.getresponse()
            if given := response.headers["set-cookie"]:
                self.cookie = given.partition(";")[0]
            return response.status, response.read().decode(errors="replace")
        finally:
            line.close()

    def token(self) -> str:
        """Return a page's fresh token.

        Raises:
            OSError: there is no page with one.
            HTTPException: no whole response.
        """
        status, page = self.request("GET", "/people")
        found = TOKEN.search(page)
        if found is None:
            raise OSError(f"a page without a token: {status}")
        return found[1]

    def post(self, path: str, **form: str) -> int:
        """Send a form as our own pages do; return the response's status.

        Raises:
            OSError: no connection, or no response in time.
            HTTPException: no whole response.
        """
        body = urlencode({"csrf": self.token(), **form})
        return self.request("POST", path, body, {"Content-Type": "application/x-www-form-urlencoded"})[0]


async def _stopping(endpoint: str) -> bool:
    async with ChannelClient(endpoint, "the station") as client:
        return (await client.request(GetPanelState(), PanelState, deadline_s=STOP_S)).stopping


def panel(url: str, endpoint: str, name: str, pin: str) -> dict[str, list[float] | int]:
    """Order *Stop* and see that the station stops, or *Start* where it is stopped, over and over."""
    person, stop_s, failed = Browser(url), list[float](), 0
    if person.post("/people/log-in", name=name, pin=pin) != 303:
        raise SystemExit("the panel cannot log in")

    def stopped_s() -> float:
        began_s = time.monotonic()
        if person.post("/order", order="stop") != 303:
            raise OSError("*Stop* is refused")
        while not asyncio.run(_stopping(endpoint)):
            if time.monotonic() > began_s + STOP_S:
                raise OSError("*Stop* is not carried out")
        return time.monotonic() - began_s

    def once() -> None:
        nonlocal failed
        try:
            if asyncio.run(_stopping(endpoint)):
                person.post("/order", order="start")
            else:
                stop_s.append(stopped_s())
        except (OSError, HTTPException, ChannelError) as error:
            failed += 1
            print(f"panel: {error!r}", file=sys.stderr)

    repeat(once, PAUSE_S, lambda: bool(stop_s or failed))
    return {"stop_s": stop_s, "failed": failed}


if __name__ == "__main__":
    found = scan(int(sys.argv[2])) if sys.argv[1] == "scan" else panel(*sys.argv[2:])
    print(json.dumps(found), flush=True)
