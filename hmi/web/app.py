"""Web application: every page behind the security middleware, over one gateway to the station."""

import asyncio
import contextlib
import logging
import uuid
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path

from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, Response
from starlette.routing import Match, Route

from hmi.api.model import ApiMessage, Error
from hmi.api.tokens import ApiTokens, RefusedTokens
from hmi.jobs.queue import Jobs
from hmi.past.past import PanelBusyError, Past, RecordsError
from hmi.past.worker import HOLDER
from hmi.web.access import holder_of, locale_of
from hmi.web.assets import Assets
from hmi.web.context import Hmi
from hmi.web.gateway import Gateway, actor_of
from hmi.web.live import Live
from hmi.web.login_limiter import LoginRateLimiter
from hmi.web.navigation import modules, parts
from hmi.web.page import show
from hmi.web.problem import Problem
from hmi.web.render import Renderer
from hmi.web.security import SecurityMiddleware
from hmi.web.sessions import Sessions
from hmi.web.streams import MOST_STREAMS, RESERVED_STREAMS
from hmi.web.user_store import FOLDER, UserStore
from station.channel.messages import ChannelError, DeadlineError
from station.channel.panel_run import PersonNoted
from station.errors import StationError
from station.messages.message import Message
from station.serving.places import Places
from station.settings.configuration import Configuration
from station.settings.hmi import panel_endpoint

_SWEEP_S = 1.0
_UNKNOWN_PATH = frozenset({HTTPStatus.NOT_FOUND.phrase, HTTPStatus.METHOD_NOT_ALLOWED.phrase})
"""The framework's own details, in place of which our words are shown; the API's details are sentences."""

log = logging.getLogger(__name__)


def make_context(site: Configuration, file: Path | None, broken: str) -> Hmi:
    """Make the parts that all pages use; the gateway is not entered yet.

    Args:
        file: of the configuration, if any.
        broken: the error in it, where `site` is the last good one; empty for none.

    Raises:
        StationError: the user store cannot be read, or the endpoint is none.
    """
    settings, boot = site.hmi, uuid.uuid4().hex[:12]
    assets, gateway = Assets(), Gateway(panel_endpoint(site.hmi, site.home), site.hmi.refresh_s)
    renderer = Renderer(assets)
    return Hmi(
        settings=settings,
        gateway=gateway,
        past=Past(site, broken),
        jobs=Jobs(site.home, site.outbox.station),
        sessions=Sessions(settings.idle_s),
        people=UserStore(site.home / FOLDER),
        pins=LoginRateLimiter(),
        tokens=ApiTokens(site.home / FOLDER),
        refused_tokens=RefusedTokens(),
        assets=assets,
        renderer=renderer,
        live=Live(parts(), renderer, gateway, boot, Places(MOST_STREAMS, settings.pages_per_address, RESERVED_STREAMS)),
        boot=boot,
        ball_recipe=site.calibration.recipe,
        configuration_file=file,
    )


def make_app(hmi: Hmi) -> SecurityMiddleware:
    """Make the application."""

    @contextlib.asynccontextmanager
    async def running(_: FastAPI) -> AsyncIterator[None]:
        async with contextlib.AsyncExitStack() as stack:
            stack.enter_context(hmi.past)
            await stack.enter_async_context(hmi.gateway)
            stack.push_async_callback(hmi.jobs.close)
            sweeping = asyncio.create_task(_sweep(hmi), name="logging out who is idle")
            try:
                yield
            finally:
                sweeping.cancel()
                await asyncio.gather(sweeping, return_exceptions=True)

    app = FastAPI(
        title="Fruit station",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        lifespan=running,
        dependencies=[Depends(_set_holder)],
        routes=[Route("/static/{digest}/{name}", hmi.assets.serve)],
        exception_handlers={
            Problem: _problem,
            HTTPException: _http,
            RequestValidationError: _bad_form,
            ChannelError: _away,
            StationError: _refused,
            Exception: _broken,
        },
    )
    app.state.hmi = hmi
    for module in modules():
        app.include_router(module.router, include_in_schema=getattr(module, "IN_SCHEMA", False))
    return SecurityMiddleware(app, (*hmi.settings.names, hmi.settings.host), secure=hmi.settings.tls.enabled)


async def _set_holder(request: Request) -> None:
    HOLDER.set(holder_of(request))


async def _sweep(hmi: Hmi) -> None:
    while True:
        await asyncio.sleep(_SWEEP_S)
        for caller in hmi.sessions.sweep():
            await hmi.gateway.note(PersonNoted(person=actor_of(caller), what="idle"))


async def _problem(request: Request, error: Problem) -> Response:
    values = dict(error.values)
    locale = locale_of(request)
    if "role" in values:
        values["role"] = locale.text(f"role.{values['role']}")
    return _problem_answer(request, error.status, locale.text(error.key, **values))


async def _http(request: Request, error: HTTPException) -> Response:
    text = locale_of(request).text("problem.not_found") if error.detail in _UNKNOWN_PATH else error.detail
    answer = _problem_answer(request, error.status_code, text)
    answer.headers.update(error.headers or {})
    if error.status_code == 405:
        answer.headers["allow"] = ", ".join(sorted(_methods(request)))
    return answer


def _methods(request: Request) -> set[str]:
    """Return the methods of a path, which several routes may serve."""
    routes = [route for module in modules() for route in module.router.routes if isinstance(route, Route)]
    found = [route for route in routes if route.matches(request.scope)[0] is not Match.NONE]
    return {method for route in found for method in route.methods or ()}


async def _bad_form(request: Request, error: RequestValidationError) -> Response:
    if request.url.path.startswith("/api/"):
        # Without what was sent: it may be no JSON, as 1e999 is read as infinity.
        wrong = [{key: each[key] for key in ("type", "loc", "msg")} for each in error.errors()]
        return JSONResponse({"detail": wrong}, 422)
    return _problem_answer(request, 400, locale_of(request).text("problem.bad_form"))


async def _away(request: Request, error: ChannelError) -> Response:
    """Answer that the station refused or did not answer, and state the result of an order where it is known."""
    status, key = (503, "problem.no_answer") if isinstance(error, DeadlineError) else (409, "problem.refused")
    return _problem_answer(request, status, locale_of(request).text(key), error.message)


async def _refused(request: Request, error: StationError) -> Response:
    """Answer with what this process itself found wrong: in the records, a recipe or a job."""
    key = "problem.records" if isinstance(error, RecordsError | PanelBusyError) else "problem.refused"
    return _problem_answer(request, 409, locale_of(request).text(key), error.message)


async def _broken(request: Request, _: Exception) -> Response:
    return _problem_answer(request, 500, locale_of(request).text("problem.broken"))


def _problem_answer(request: Request, status: int, text: str, detail: Message | None = None) -> Response:
    if request.url.path.startswith("/api/"):
        body = Error(detail=f"{text} {detail or ''}".strip(), message=detail and ApiMessage.of(detail))
        return JSONResponse(body.model_dump(mode="json", exclude_none=True), status)
    return show(request, "problem.html.j2", status=status, text=text, detail=detail)
