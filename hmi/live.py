"""The parts of pages that change by themselves: rendered once for all browsers, sent where they are looked at."""

import asyncio
import hashlib
import json
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from typing import Any, NamedTuple

from markupsafe import Markup

from hmi.gateway import Gateway
from hmi.render import Renderer
from hmi.roles import RIGHTS, Right, Role
from hmi.sessions import Caller
from hmi.words import Wording
from station.settings.hmi import Language

BEAT_S = 0.5
"""How often a page hears that all is well where nothing has changed."""


class Part(NamedTuple):
    """A part of a page."""

    template: str
    depends_on: Callable[[Gateway], object]
    """Filled in anew when this is no longer equal to what it was; cheap."""
    values: Callable[[Gateway, Wording], Mapping[str, Any]]
    """What the template needs, beside `may(right)`; `gateway.state` may be None, or old: the page says how old."""


class Filled(NamedTuple):
    """A part as it is now."""

    digest: str
    html: Markup


class Live:
    """All parts of all pages.

    Args:
        parts: by their names, `page.what`.
        renderer: fills them in.
        gateway: the station.
        boot: another one after each start of this process: the page loads itself anew.
    """

    def __init__(self, parts: Mapping[str, Part], renderer: Renderer, gateway: Gateway, boot: str) -> None:
        self._parts, self._renderer, self._gateway, self._boot = parts, renderer, gateway, boot
        self._filled: dict[tuple[str, Language, Role], tuple[object, Filled]] = {}
        self.open = 0
        """Streams under way."""
        self.ending = False
        """The process is told to end: streams end."""

    def unknown(self, names: Iterable[str]) -> bool:
        """Whether any of them is no part.

        Args:
            names: as asked for.
        """
        return any(name not in self._parts for name in names)

    def part(self, name: str, wording: Wording, role: Role) -> Filled:
        """A part as it is now.

        Args:
            name: a known one.
            wording: the language.
            role: of who looks at it; an order within it has no token, which the page's script fills in.
        """
        part = self._parts[name]
        depends_on = part.depends_on(self._gateway)
        known = self._filled.get((name, wording.language, role))
        if known is not None and known[0] == depends_on:
            return known[1]
        values = {**part.values(self._gateway, wording), "may": RIGHTS[role].__contains__, "Right": Right}
        html = self._renderer.render(part.template, wording, values)
        filled = Filled(hashlib.sha256(html.encode()).hexdigest()[:12], html)
        self._filled[name, wording.language, role] = depends_on, filled
        return filled

    async def stream(
        self, names: tuple[str, ...], wording: Wording, caller: Callable[[], Caller]
    ) -> AsyncIterator[bytes]:
        """Server-sent events for one page, until it goes away. A browser that takes them slowly gets fewer.

        Args:
            names: the page's parts.
            wording: its language.
            caller: who is logged in there now; the page loads itself anew when that changes.
        """
        sent: dict[str, str] = {}
        loop, beat_at_s = asyncio.get_running_loop(), 0.0
        while not self.ending:
            who = caller()
            filled = {name: self.part(name, wording, who.role) for name in names}
            news = {name: each for name, each in filled.items() if sent.get(name) != each.digest}
            if news or loop.time() >= beat_at_s:
                beat_at_s = loop.time() + BEAT_S
                age_s = self._gateway.age_s
                told = {
                    "age_ms": None if age_s is None else round(1000 * age_s),
                    "utc_ms": 0 if self._gateway.state is None else self._gateway.state.utc_ms,
                    "boot": self._boot,
                    "caller": f"{who.name}|{who.role}",
                    "parts": {name: [each.digest, each.html] for name, each in news.items()},
                }
                yield f"data: {json.dumps(told, ensure_ascii=False)}\n\n".encode()
                sent |= {name: each.digest for name, each in news.items()}
            await self._gateway.looked()
