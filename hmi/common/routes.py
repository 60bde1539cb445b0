"""Common layout of all pages: alarm line, station state, live stream, language."""

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Form, Query, Request
from starlette.responses import Response, StreamingResponse

from hmi.web.access import (
    LANGUAGE_COOKIE,
    PANEL_COOKIE,
    GenuineCaller,
    HmiNow,
    LocaleNow,
    address_of,
    caller_of,
    cookie_name,
    holder_of,
)
from hmi.web.context import Hmi
from hmi.web.gateway import Gateway
from hmi.web.live import Part, of_state
from hmi.web.page import go_to, is_ours
from hmi.web.problem import Problem
from hmi.web.streams import Stream
from hmi.web.translation import Locale

router = APIRouter()
MOST_PARTS = 20
_A_YEAR_S = 365 * 24 * 3600


def _alarm_values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    state = gateway.state
    shown = [] if state is None else [each for each in state.alarms if each.shelved_until_utc_ms is None]
    return {"alarms": sorted(shown, key=lambda each: not each.active), "heard": state is not None}


PARTS = {
    "frame.alarm": Part("layout_alarm.html.j2", of_state(lambda state: state.alarms), _alarm_values),
    "frame.state": Part(
        "layout_state.html.j2",
        of_state(lambda state: (state.state, state.ready, state.why_not_ready, state.recipe, state.simulated)),
        lambda gateway, _: {"state": gateway.state},
    ),
}


@router.get("/live")
async def live(
    request: Request, hmi: HmiNow, locale: LocaleNow, part: Annotated[list[str], Query(max_length=MOST_PARTS)]
) -> Response:
    """Send server-sent events with a page's parts; see `hmi.web.live`."""
    if hmi.live.unknown(part):
        raise Problem(404, "problem.not_found")
    caller = caller_of(request)
    stream = Stream(holder_of(request), known=bool(caller.name) or hmi.pins.knows(address_of(request)))
    events = hmi.live.stream(stream, tuple(dict.fromkeys(part)), locale, lambda: hmi.sessions.caller(caller.session))
    # Kept open for another request, the connection of a stream that has ended would keep its place.
    return StreamingResponse(events, media_type="text/event-stream", headers={"connection": "close"})


@router.get("/panel")
async def panel(hmi: HmiNow) -> Response:
    """Begin at a panel without a keyboard: this browser gets one on the screen. A panel's browser opens this page."""
    answer = go_to("/")
    _set_cookie(answer, hmi, PANEL_COOKIE, "1")
    return answer


@router.post("/here")
async def here(request: Request, hmi: HmiNow) -> Response:
    """Restart the idle time: a person has touched the page."""
    hmi.sessions.touch(caller_of(request).session)
    return Response(status_code=204)


@router.post("/language")
async def language(
    _: GenuineCaller,
    hmi: HmiNow,
    language: Annotated[str, Form(max_length=8)],
    back: Annotated[str, Form(max_length=200)] = "/",
) -> Response:
    """Set the language of this browser."""
    if language not in hmi.settings.languages:
        raise Problem(400, "problem.bad_form")
    answer = go_to(back if is_ours(back) else "/")
    _set_cookie(answer, hmi, LANGUAGE_COOKIE, language)
    return answer


def _set_cookie(answer: Response, hmi: Hmi, cookie: str, value: str) -> None:
    name, secure = cookie_name(hmi, cookie), hmi.settings.tls.enabled
    answer.set_cookie(name, value, max_age=_A_YEAR_S, secure=secure, httponly=True, samesite="strict")
