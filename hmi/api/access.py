"""Authentication of the HTTP API: a system by its token, or a person who is logged in at the pages."""

from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import Depends, HTTPException, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from hmi.web.access import caller_of, genuine, hmi_of
from hmi.web.gateway import actor_of
from hmi.web.roles import RIGHTS, Right, Role
from station.channel.panel import Actor
from station.channel.panel_run import PersonNoted

LONGEST_TOKEN = 200
_bearer = HTTPBearer(
    auto_error=False,
    scheme_name="token",
    description="Made by `station api-token add NAME`; or the cookie of a person who is logged in at the pages.",
)
Bearer = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
_API = Actor(who="api", role="viewer")
_CHALLENGE = {"www-authenticate": "Bearer"}


async def reader(request: Request, bearer: Bearer) -> Actor:
    """Return the caller, who may read: the owner of any token, or any person who is logged in.

    Raises:
        HTTPException: 401, neither a valid token nor a log-in.
    """
    if bearer is not None:
        token = bearer.credentials
        owner = hmi_of(request).tokens.holder(token) if len(token) <= LONGEST_TOKEN else None
        if owner is None:
            await _note_refused(request)
            raise HTTPException(
                401, "this token is not known, or has expired; make one with `station api-token add`", _CHALLENGE
            )
        name, role = owner
        return Actor(who=name, role=role)
    caller = caller_of(request)
    if not caller.name:
        raise HTTPException(401, "give a token, as `Authorization: Bearer TOKEN`", _CHALLENGE)
    return actor_of(caller)


def changer(right: Right) -> Callable[[Request, HTTPAuthorizationCredentials | None], Awaitable[Actor]]:
    """Make a dependency for what changes something. A browser's order needs the page's token beside the cookie."""

    async def check(request: Request, bearer: Bearer) -> Actor:
        actor = await reader(request, bearer)
        if bearer is None:
            await genuine(request)
        if right not in RIGHTS[Role(actor.role)]:
            raise HTTPException(
                403, f"{actor.who} has no right to do this: use a token, or log in as a person, of another role"
            )
        return actor

    return check


async def _note_refused(request: Request) -> None:
    number = hmi_of(request).refused_tokens.count()
    if number is not None:
        address = request.client.host if request.client else "unknown"
        subject = f"from {address}, number {number} of this hour"
        await hmi_of(request).gateway.note(PersonNoted(person=_API, what="token_refused", subject=subject))
