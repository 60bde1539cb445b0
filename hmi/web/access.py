"""Access control of the pages: caller, rights, and the one-time token of each order."""

from collections.abc import Awaitable, Callable
from typing import Annotated, Any

from fastapi import Depends, Request

from hmi.web.context import Hmi
from hmi.web.problem import Problem
from hmi.web.roles import Right, Role, least_role
from hmi.web.sessions import Caller
from hmi.web.translation import Locale, preferred

SESSION_COOKIE, LANGUAGE_COOKIE, PANEL_COOKIE = "session", "language", "panel"
TOKEN_FIELD, TOKEN_HEADER = "csrf", "x-csrf-token"


def hmi_of(request: Request) -> Hmi:
    """Return the process's parts."""
    return request.app.state.hmi


def cookie_name(hmi: Hmi, cookie: str) -> str:
    """Return a cookie's name, with our port: a browser sends a machine's cookies to the other stations there too."""
    return f"station_{cookie}_{hmi.settings.port}"


def caller_of(request: Request) -> Caller:
    """Return the caller; a viewer if nobody is logged in. A browser without a cookie gets one with the page."""
    session = request.cookies.get(cookie_name(hmi_of(request), SESSION_COOKIE), "")
    if not session:
        session = getattr(request.state, "new_session", "") or hmi_of(request).sessions.new()
        request.state.new_session = session
    return hmi_of(request).sessions.caller(session)


def at_panel(request: Request) -> bool:
    """Return whether the browser is a panel's: it has no keyboard, and saves and prints nothing."""
    return cookie_name(hmi_of(request), PANEL_COOKIE) in request.cookies


def locale_of(request: Request) -> Locale:
    """Return the language to answer in."""
    hmi, accepted = hmi_of(request), request.headers.get("accept-language", "")
    chosen = request.cookies.get(cookie_name(hmi, LANGUAGE_COOKIE), "")
    return Locale(preferred(hmi.settings.languages, chosen, accepted))


def address_of(request: Request) -> str:
    """Return the address of the browser."""
    return request.client.host if request.client else ""


def holder_of(request: Request) -> str:
    """Return the holder of a request's places and turns: the person, or the address where nobody is logged in."""
    caller = caller_of(request)
    return f"person {caller.name}" if caller.name else address_of(request)


async def genuine(request: Request) -> Caller:
    """Return the caller of an order that one of our own pages has sent, for the first time.

    Args:
        request: with the page's token in the form's field `csrf` or the header `X-CSRF-Token`.

    Raises:
        Problem: 403, forged or too old; 409, sent before.
    """
    caller = caller_of(request)
    token: Any = request.headers.get(TOKEN_HEADER)
    if token is None:
        token = (await request.form()).get(TOKEN_FIELD, "")
    wrong = hmi_of(request).sessions.spend(caller.session, token if isinstance(token, str) else "")
    if wrong:
        raise Problem(409 if wrong == "problem.replayed" else 403, wrong)
    hmi_of(request).sessions.touch(caller.session)
    return caller


def may(right: Right) -> Callable[[Request], Awaitable[Caller]]:
    """Make a dependency for a page or a file that needs a right."""

    async def check(request: Request) -> Caller:
        return _with_right(caller_of(request), right)

    return check


def orders(right: Right) -> Callable[[Request], Awaitable[Caller]]:
    """Make a dependency for every request that changes something: the token is checked first, then the role."""

    async def check(request: Request) -> Caller:
        return _with_right(await genuine(request), right)

    return check


def _with_right(caller: Caller, right: Right) -> Caller:
    if not caller.may(right):
        raise Problem(403, "problem.not_allowed", role=least_role(right))
    return caller


def known(caller: Caller) -> Caller:
    """Return a caller who is logged in, in any role.

    Raises:
        Problem: 403, the caller is not logged in.
    """
    if not caller.name:
        raise Problem(403, "problem.not_allowed", role=Role.OPERATOR)
    return caller


# Async, though they await nothing: FastAPI hands any other function to a thread, for which each request would wait.
async def _hmi(request: Request) -> Hmi:
    return hmi_of(request)


async def _locale(request: Request) -> Locale:
    return locale_of(request)


HmiNow = Annotated[Hmi, Depends(_hmi)]
GenuineCaller = Annotated[Caller, Depends(genuine)]
LocaleNow = Annotated[Locale, Depends(_locale)]
