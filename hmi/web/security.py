"""Security middleware: checks of every request before a page gets it, and the headers of every answer."""

import contextlib
import re
from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY_BYTES = 256 * 1024
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; font-src 'self'; "
    "manifest-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",  # with no-referrer a browser would send its forms with "Origin: null"
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
}
_HOST = re.compile(r"(?:\[(?P<address>[0-9A-Fa-f.]*:[0-9A-Fa-f:.]+)\]|(?P<name>[A-Za-z0-9.-]+))(?::[0-9]{1,5})?")
_SECURE = {"strict-transport-security": "max-age=31536000"}


class BodyError(Exception):
    """A request body that is too large, or whose client has gone."""


class SecurityMiddleware:
    """Refuses requests for a foreign host's name, from a foreign page, or too large, before they are read.

    Args:
        secure: whether TLS is served.
    """

    def __init__(self, app: ASGIApp, names: Iterable[str], *, secure: bool) -> None:
        self._app, self._names = app, frozenset(name.lower() for name in names)
        self._scheme = "https" if secure else "http"
        self._headers = {**HEADERS, **(_SECURE if secure else {})}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers.items():
                    headers.setdefault(name, value)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        if refused := self._refusal(Headers(scope=scope), scope["method"]):
            await refused(scope, receive, send_with_headers)
        else:
            await self._within_size(scope, receive, send_with_headers)

    async def _within_size(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request whose body may be larger than its header states, or not come to its end."""
        taken, more = 0, True

        async def take() -> Message:
            nonlocal taken, more
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > LARGEST_BODY_BYTES or (more and message["type"] == "http.disconnect"):
                raise BodyError
            more = message.get("more_body", False)
            return message

        async def send_if_small(message: Message) -> None:
            if taken <= LARGEST_BODY_BYTES:  # else the framework's answer hides the cause
                await send(message)

        with contextlib.suppress(BodyError):
            await self._app(scope, take, send_if_small)
        if taken > LARGEST_BODY_BYTES:
            await _too_large()(scope, receive, send)

    def _refusal(self, headers: Headers, method: str) -> PlainTextResponse | None:
        host = headers.get("host", "")
        if _name_of(host) not in self._names:
            return PlainTextResponse(f"{host!r} is not a name of this station: see hmi.names", 421)
        if method not in SAFE_METHODS and not self._own(headers, host):
            return PlainTextResponse("this order comes from a page that is not this station's", 403)
        length = headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit() or int(length[:12]) > LARGEST_BODY_BYTES:
            return _too_large()
        return None

    def _own(self, headers: Headers, host: str) -> bool:
        """Return whether the browser names one of our pages as the origin; true for a program that is no browser."""
        site, origin = headers.get("sec-fetch-site"), headers.get("origin")
        return site in {None, "same-origin", "none"} and origin in {None, f"{self._scheme}://{host}"}


def _name_of(host: str) -> str:
    """Return a Host header's name without its port; empty where it is neither a name nor an address."""
    found = _HOST.fullmatch(host)
    return (found["address"] or found["name"]).lower() if found else ""


def _too_large() -> PlainTextResponse:
    return PlainTextResponse(
        f"a request may hold {LARGEST_BODY_BYTES} bytes at most", 413, headers={"connection": "close"}
    )
