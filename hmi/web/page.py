"""Page rendering: a page's template within the common layout."""

from collections.abc import Mapping
from typing import Any

from fastapi import Request
from fastapi.responses import HTMLResponse, RedirectResponse
from markupsafe import Markup
from starlette.responses import Response

from hmi.web.access import SESSION_COOKIE, at_panel, caller_of, cookie_name, hmi_of, locale_of
from hmi.web.context import Hmi
from hmi.web.navigation import entries
from hmi.web.roles import Right, Role
from hmi.web.translation import Locale


def show(request: Request, template: str, *, status: int = 200, **values: Any) -> Response:
    """Answer with a page.

    Args:
        template: extends `base.html.j2`.
        values: the page's own, in addition to those of every page: `caller`, `Right`, `state` (the station's, or None),
            `token()` for a form, and `live(name)`, which inserts a live part.
    """
    hmi, caller, locale = hmi_of(request), caller_of(request), locale_of(request)
    age_s = hmi.gateway.age_s
    frame = {
        "caller": caller,
        "Right": Right,
        "state": hmi.gateway.state,
        "fresh": hmi.gateway.fresh,
        "age_ms": -1 if age_s is None else round(1000 * age_s),
        "boot": hmi.boot,
        "settings": hmi.settings,
        "entries": entries(),
        "path": request.url.path,
        "is_page": request.method == "GET",  # an order's address is none to come back to
        "first_start": hmi.people.first_start,
        "token": lambda: hmi.sessions.token(caller.session),
        "on_panel": at_panel(request),
        "live": lambda name: _live(hmi, locale, caller.role, name),
    }
    answer = HTMLResponse(hmi.renderer.render(template, locale, {**frame, **values}), status)
    give_session(request, answer, getattr(request.state, "new_session", ""))
    # The answer to a page's own poll is a page only where it failed: that is nobody's touch.
    if caller.name and request.method == "GET" and status < 400:
        hmi.sessions.touch(caller.session)
    return answer


def show_part(
    hmi: Hmi, locale: Locale, template: str, values: Mapping[str, Any], headers: Mapping[str, str] | None = None
) -> Response:
    """Answer with a part of a page, for polling."""
    return Response(hmi.renderer.render(template, locale, values), media_type="text/html", headers=headers)


def give_session(request: Request, answer: Response, session: str) -> None:
    """Set the browser's cookie if it is new."""
    if session:
        hmi = hmi_of(request)
        name, secure = cookie_name(hmi, SESSION_COOKIE), hmi.settings.tls.enabled
        # With "strict" a link from another site comes without the cookie, and a new one would log the person out.
        # No order depends on it: each is a POST from our own page with a token.
        answer.set_cookie(name, session, secure=secure, httponly=True, samesite="lax", path="/")


def go_to(address: str) -> RedirectResponse:
    """Answer an order by redirecting to a page, which can be reloaded without repeating the order."""
    return RedirectResponse(address, 303)


def is_ours(address: str) -> bool:
    """Return whether the address to go back to is a page of ours, and not inserted by a foreign page."""
    return address.startswith("/") and not address.startswith(("//", "/\\")) and address.isprintable()


def _live(hmi: Hmi, locale: Locale, role: Role, name: str) -> Markup:
    filled = hmi.live.part(name, locale, role)
    return Markup('<div data-live="{}" data-digest="{}">{}</div>').format(name, filled.digest, filled.html)
