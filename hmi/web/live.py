"""Live parts of pages: rendered once for all browsers, sent only to the pages that show them."""

import asyncio
import hashlib
import json
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from typing import Any, NamedTuple

from markupsafe import Markup

from hmi.web.gateway import Gateway
from hmi.web.render import Renderer
from hmi.web.roles import RIGHTS, Right, Role
from hmi.web.sessions import Caller
from hmi.web.streams import Stream
from hmi.web.translation import Locale
from station.channel.panel_run import PanelState
from station.serving.places import Places
from station.settings.hmi import Language

BEAT_S = 0.5
"""Period of a page's events if nothing changes."""
AGAIN_MS = 1000
"""A page whose stream has ended, as because another page has its place, asks again after this time."""


class Part(NamedTuple):
    """A part of a page."""

    template: str
    depends_on: Callable[[Gateway], object]
    """Filled in anew when this is no longer equal to what it was; cheap."""
    values: Callable[[Gateway, Locale], Mapping[str, Any]]
    """The template's values, beside `may(right)`; `gateway.state` may be None, or old: the page shows its age."""


def of_state(select: Callable[[PanelState], object]) -> Callable[[Gateway], object]:
    """Make what a part depends on: a selection of the station's state, None until there is one."""
    return lambda gateway: None if gateway.state is None else select(gateway.state)


class Filled(NamedTuple):
    """A part's present content."""

    digest: str
    html: Markup


class Live:
    """Live parts of all pages.

    Args:
        parts: by their names, `page.what`.
        boot: differs after each start of this process; then a page reloads itself.
    """

    def __init__(
        self, parts: Mapping[str, Part], renderer: Renderer, gateway: Gateway, boot: str, places: Places[Stream]
    ) -> None:
        self._parts, self._renderer, self._gateway, self._boot = parts, renderer, gateway, boot
        self.places = places
        self._filled: dict[tuple[str, Language, Role], tuple[object, Filled]] = {}
        self.ending = False
        """The process ends: streams end."""

    def unknown(self, names: Iterable[str]) -> bool:
        """Return whether any of the names is not a part."""
        return any(name not in self._parts for name in names)

    def part(self, name: str, locale: Locale, role: Role) -> Filled:
        """Return a part's present content for a role; the page's script fills in the tokens of its orders."""
        part = self._parts[name]
        depends_on = part.depends_on(self._gateway)
        known = self._filled.get((name, locale.language, role))
        if known is not None and known[0] == depends_on:
            return known[1]
        values = {**part.values(self._gateway, locale), "may": RIGHTS[role].__contains__, "Right": Right}
        html = self._renderer.render(part.template, locale, values)
        filled = Filled(hashlib.sha256(html.encode()).hexdigest()[:12], html)
        self._filled[name, locale.language, role] = depends_on, filled
        return filled

    async def stream(
        self, stream: Stream, names: tuple[str, ...], locale: Locale, caller: Callable[[], Caller]
    ) -> AsyncIterator[bytes]:
        """Send server-sent events to one page until it closes or is displaced. A slow browser gets fewer.

        Args:
            stream: gets its place with the first event, and leaves it with the last.
            caller: returns who is logged in there now; the page reloads itself when that changes.
        """
        self.places.enter(stream)
        try:
            async for event in self._events(stream, names, locale, caller):
                yield event
        finally:
            self.places.leave(stream)

    async def _events(
        self, stream: Stream, names: tuple[str, ...], locale: Locale, caller: Callable[[], Caller]
    ) -> AsyncIterator[bytes]:
        yield f"retry: {AGAIN_MS}\n\n".encode()
        sent: dict[str, str] = {}
        loop, beat_at_s = asyncio.get_running_loop(), 0.0
        while not self.ending and not stream.displaced.done():
            who = caller()
            filled = {name: self.part(name, locale, who.role) for name in names}
            news = {name: each for name, each in filled.items() if sent.get(name) != each.digest}
            if news or loop.time() >= beat_at_s:
                beat_at_s = loop.time() + BEAT_S
                age_s = self._gateway.age_s
                event = {
                    "age_ms": None if age_s is None else round(1000 * age_s),
                    "utc_ms": 0 if self._gateway.state is None else self._gateway.state.utc_ms,
                    "boot": self._boot,
                    "caller": f"{who.name}|{who.role}",
                    "parts": {name: [each.digest, each.html] for name, each in news.items()},
                }
                yield f"data: {json.dumps(event, ensure_ascii=False)}\n\n".encode()
                sent |= {name: each.digest for name, each in news.items()}
            # A displaced stream ends at once: until then its connection is one of those that its address may have.
            await asyncio.wait({self._gateway.polled(), stream.displaced}, return_when=asyncio.FIRST_COMPLETED)
