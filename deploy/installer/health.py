"""Health check of a station after its start."""

import http.client
import json
import time
from pathlib import Path
from typing import Any

from installer.layout import Layout
from installer.messages import Failed
from installer.programs import station

LIMIT_S = 120.0
_ASK_S = 3.0


def ready(layout: Layout, release: Path) -> bool:
    """Return whether it would accept a trigger now; also False if it does not answer."""
    try:
        return _get(*_address(layout, release), "/readyz")[0] == http.HTTPStatus.OK
    except (Failed, OSError, http.client.HTTPException):
        return False


def wait_until_healthy(
    layout: Layout,
    release: Path,
    version: str,
    *,
    was_ready: bool,
    needs_records: bool = True,
    limit_s: float = LIMIT_S,
) -> None:
    """Wait until the station is alive, has this version, can use its records, and is ready again if it was before.

    A station without devices is alive and not ready: on a first start nothing else is to be expected. One that cannot
    open its records is alive as well.

    Args:
        layout: its configuration has the station's address.
        release: the started one.
        was_ready: whether the one before it would have accepted a trigger.
        needs_records: False for a rollback, which is done when the old release answers.

    Raises:
        Failed: it is not healthy by then; with its report.
    """
    address, deadline_s, trouble = _address(layout, release), time.monotonic() + limit_s, "it does not answer"
    while time.monotonic() < deadline_s:
        try:
            trouble = _trouble(address, version, was_ready=was_ready, needs_records=needs_records)
        except (OSError, http.client.HTTPException, ValueError) as error:
            trouble = f"it does not answer: {error}"
        if not trouble:
            return
        time.sleep(0.5)
    raise Failed(f"the station is not healthy {limit_s:g} s after its start: {trouble}")


def _trouble(address: tuple[str, int], version: str, *, was_ready: bool, needs_records: bool) -> str:
    status, _ = _get(*address, "/livez")
    if status != http.HTTPStatus.OK:
        return "/livez reports no progress"
    found = _get(*address, "/version")[1].get("fruit-station")
    if found != version:
        return f"version {found} answers, not {version}"
    status, answer = _get(*address, "/readyz")
    if was_ready and status != http.HTTPStatus.OK:
        return f"it was ready before and is not now: {answer.get('why')}"
    if not needs_records:
        return ""
    faults = (each for each in answer.get("dependencies", ()) if each["name"] == "records" and each["state"] == "fault")
    return next((f"it cannot use its records: {each['detail']}; {each['remedy']}" for each in faults), "")


def _address(layout: Layout, release: Path) -> tuple[str, int]:
    metrics = json.loads(station(layout, release, "config", "show"))["metrics"]
    host = str(metrics["host"])
    address = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 (a client, no listener)
    return address, metrics["port"]


def _get(host: str, port: int, path: str) -> tuple[int, dict[str, Any]]:
    connection = http.client.HTTPConnection(host, port, timeout=_ASK_S)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        content = answer.read()
    finally:
        connection.close()
    return answer.status, json.loads(content) if content.startswith(b"{") else {}
