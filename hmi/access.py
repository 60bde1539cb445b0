"""The doors of the pages: who asks, whether they may, and whether the order comes from one of our pages, once."""

from collections.abc import Awaitable, Callable
from typing import Annotated, Any

from fastapi import Depends, Request

from hmi.context import Hmi
from hmi.problem import Problem
from hmi.roles import Right, least_role
from hmi.sessions import Caller
from hmi.words import Wording, preferred

SESSION_COOKIE, LANGUAGE_COOKIE = "station_session", "station_language"
TOKEN_FIELD, TOKEN_HEADER = "csrf", "x-csrf-token"


def hmi_of(request: Request) -> Hmi:
    """The process's parts.

    Args:
        request: any.
    """
    return request.app.state.hmi


def caller_of(request: Request) -> Caller:
    """Who asks; a viewer where nobody is logged in.

    Args:
        request: any; a browser without a cookie gets one with the page.
    """
    session = request.cookies.get(SESSION_COOKIE, "")
    if not session:
        session = getattr(request.state, "new_session", "") or hmi_of(request).sessions.new()
        request.state.new_session = session
    return hmi_of(request).sessions.caller(session)


def wording_of(request: Request) -> Wording:
    """The language in which to answer.

    Args:
        request: any.
    """
    cookie, accepted = request.cookies.get(LANGUAGE_COOKIE, ""), request.headers.get("accept-language", "")
    return Wording(preferred(hmi_of(request).settings.languages, cookie, accepted))


async def genuine(request: Request) -> Caller:
    """The caller of an order that one of our own pages has sent, for the first time.

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
    """A dependency for a page or a file that not everybody may see.

    Args:
        right: that the caller needs.
    """

    async def check(request: Request) -> Caller:
        return _with_right(caller_of(request), right)

    return check


def orders(right: Right) -> Callable[[Request], Awaitable[Caller]]:
    """A dependency for everything that changes something: the token first, then the role.

    Args:
        right: that the caller needs.
    """

    async def check(request: Request) -> Caller:
        return _with_right(await genuine(request), right)

    return check


def _with_right(caller: Caller, right: Right) -> Caller:
    if not caller.may(right):
        raise Problem(403, "problem.not_allowed", role=least_role(right))
    return caller


HmiNow = Annotated[Hmi, Depends(hmi_of)]
CallerNow = Annotated[Caller, Depends(caller_of)]
GenuineCaller = Annotated[Caller, Depends(genuine)]
WordingNow = Annotated[Wording, Depends(wording_of)]
