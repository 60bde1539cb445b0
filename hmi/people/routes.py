"""People page: log-in by PIN, users and their roles, and the cleaning lock."""

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Form, Query, Request
from starlette.responses import Response

from hmi.web.access import GenuineCaller, HmiNow, address_of, known, orders
from hmi.web.context import Hmi
from hmi.web.gateway import actor_of
from hmi.web.navigation import Entry
from hmi.web.page import give_session, go_to, is_ours, show
from hmi.web.problem import Problem
from hmi.web.roles import Right, Role
from hmi.web.sessions import Caller
from hmi.web.user_store import UserStoreError, least_digits
from station.channel.panel_run import PersonNoted
from station.serving.guard import is_this_machines

router = APIRouter()
ENTRY = Entry("people", "/people")
Name = Annotated[str, Form(max_length=40)]
Pin = Annotated[str, Form(max_length=20)]
Back = Annotated[str, Form(max_length=200)]
Admin = Annotated[Caller, Depends(orders(Right.MANAGE_PEOPLE))]
_CHECKING = asyncio.Lock()
"""One PIN at a time: each takes 19 MiB and a core for a moment. Changes of people wait for it too."""


@router.get("/people")
async def people(request: Request, hmi: HmiNow, back: Annotated[str, Query(max_length=200)] = "/") -> Response:
    """Show the page."""
    return _page(request, hmi, back)


@router.post("/people/begin")
async def begin(request: Request, hmi: HmiNow, _: GenuineCaller, name: Name, pin: Pin, again: Pin) -> Response:
    """Set the administrator's PIN at the first start, at the machine itself."""
    if not is_this_machines(address_of(request)):
        raise Problem(403, "people.only_here")
    if pin != again:
        return _page(request, hmi, wrong="people.pin_differs", name=name)
    try:
        async with _CHECKING:
            await asyncio.to_thread(hmi.people.begin, name, pin)
    except UserStoreError as error:
        return _page(request, hmi, wrong=error.key, detail=error.detail, name=name)
    await _note(hmi, Caller(name, Role.ADMIN, ""), "added", name)
    return _logged_in(request, hmi, name, Role.ADMIN, "/people")


@router.post("/people/log-in")
async def log_in(
    request: Request, hmi: HmiNow, caller: GenuineCaller, name: Name, pin: Pin, back: Back = "/"
) -> Response:
    """Log in; after several wrong PINs each further try is delayed."""
    who = name if name in hmi.people.names() else "", address_of(request)
    if (wait_s := hmi.pins.wait_s(*who)) > 0:
        return _page(request, hmi, back, "people.wait", str(int(wait_s) + 1), status=429, name=name)
    hmi.pins.tried(*who)
    async with _CHECKING:  # a change of this PIN, which comes after it, ends this session too
        role = await asyncio.to_thread(hmi.people.check, name, pin)
        answer = None if role is None else _logged_in(request, hmi, name, role, back)
    if role is None or answer is None:
        await _note(hmi, Caller(name, Role.VIEWER, ""), "log_in_refused", address_of(request))
        return _page(request, hmi, back, "people.wrong_pin", status=403, name=name)
    hmi.pins.right(*who)
    hmi.sessions.log_out(caller.session)
    await _note(hmi, Caller(name, role, ""), "logged_in", address_of(request))
    return answer


@router.post("/people/log-out")
async def log_out(hmi: HmiNow, caller: GenuineCaller) -> Response:
    """Log out; the page continues as a viewer's."""
    hmi.sessions.log_out(caller.session)
    if caller.name:
        await _note(hmi, caller, "logged_out")
    return go_to("/")


@router.post("/people/own-pin")
async def own_pin(request: Request, hmi: HmiNow, caller: GenuineCaller, old: Pin, pin: Pin) -> Response:
    """Change one's own PIN; one's other sessions end."""
    who = known(caller).name, address_of(request)
    if (wait_s := hmi.pins.wait_s(*who)) > 0:
        return _page(request, hmi, wrong="people.wait", detail=str(int(wait_s) + 1), status=429)
    hmi.pins.tried(*who)
    async with _CHECKING:
        role = await asyncio.to_thread(hmi.people.check, caller.name, old)
        if role is not None:
            hmi.pins.right(*who)
            try:
                await asyncio.to_thread(hmi.people.put, caller.name, role, pin)
            except UserStoreError as error:
                return _page(request, hmi, wrong=error.key, detail=error.detail)
            hmi.sessions.forget(caller.name)
    if role is None:
        await _note(hmi, caller, "log_in_refused", address_of(request))
        return _page(request, hmi, wrong="people.wrong_pin", status=403)
    await _note(hmi, caller, "changed", caller.name)
    return _logged_in(request, hmi, caller.name, role, "/people")


@router.post("/people/put")
async def put(
    request: Request, hmi: HmiNow, caller: Admin, name: Name, role: Annotated[Role, Form()], pin: Pin = ""
) -> Response:
    """Add a user, or change a user's role or PIN; that user's sessions end, one's own other sessions too."""
    known = name in hmi.people.names()
    try:
        async with _CHECKING:
            await asyncio.to_thread(hmi.people.put, name, role, pin)
            hmi.sessions.forget(name)
    except UserStoreError as error:
        return _page(request, hmi, wrong=error.key, detail=error.detail, form="put", name=name, role=role)
    await _note(hmi, caller, "changed" if known else "added", f"{name}: {role}")
    return _logged_in(request, hmi, name, role, "/people") if name == caller.name else go_to("/people")


@router.post("/people/remove")
async def remove(request: Request, hmi: HmiNow, caller: Admin, name: Name) -> Response:
    """Remove a user."""
    try:
        async with _CHECKING:  # after a log-in or a new PIN of this person that is under way, which it ends too
            await asyncio.to_thread(hmi.people.remove, name)
            hmi.sessions.forget(name)
    except UserStoreError as error:
        return _page(request, hmi, wrong=error.key, detail=error.detail, form="remove")
    await _note(hmi, caller, "removed", name)
    return go_to("/people")


@router.post("/people/clean")
async def clean(hmi: HmiNow, caller: GenuineCaller) -> Response:
    """Record the cleaning lock, which the page sets and releases by itself."""
    await _note(hmi, caller, "cleaning", f"{hmi.settings.cleaning_s:g} s")
    return Response(status_code=204)


def _page(
    request: Request,
    hmi: Hmi,
    back: str = "/",
    wrong: str = "",
    detail: str = "",
    *,
    status: int = 0,
    form: Literal["own", "put", "remove"] = "own",
    name: str = "",
    role: Role | None = None,
) -> Response:
    """Show the page; with an error, at the form that was sent, with the name and the role as they were sent."""
    return show(
        request,
        "people.html.j2",
        status=status or (400 if wrong else 200),
        back=back if is_ours(back) else "/",
        wrong=wrong,
        detail=detail,
        form=form,
        chosen=name,
        chosen_role=role,
        people=hmi.people.names(),
        broken=hmi.people.broken,
        here=is_this_machines(address_of(request)),
        roles=[role for role in Role if role is not Role.VIEWER],
        least_digits={role: least_digits(role) for role in Role},
    )


def _logged_in(request: Request, hmi: Hmi, name: str, role: Role, back: str) -> Response:
    answer = go_to(back if is_ours(back) else "/")
    give_session(request, answer, hmi.sessions.log_in(name, role))
    return answer


async def _note(hmi: Hmi, caller: Caller, what: str, subject: str = "") -> None:
    await hmi.gateway.note(PersonNoted(person=actor_of(caller), what=what, subject=subject))  # pyrefly: ignore[bad-argument-type] (the model checks it)
