"""Authentication of the HTTP API: a system by its token, or a person who is logged in at the pages."""

import math
import time
from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import Depends, HTTPException, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from hmi.api.tokens import ApiTokens
from hmi.web.access import caller_of, genuine, hmi_of
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
_COUNTED_S = 3600.0
_API = Actor(who="api", role="viewer")
_CHALLENGE = {"www-authenticate": "Bearer"}


def tokens_of(request: Request) -> ApiTokens:
    """Return the station's tokens."""
    state = request.app.state
    if not hasattr(state, "api_tokens"):
        state.api_tokens = ApiTokens(hmi_of(request).people.path.parent)
    return state.api_tokens


class RefusedTokens:
    """Count of refused tokens: only the first, tenth, hundredth … of an hour get into the audit trail, to spare it."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began_s = -math.inf
        self._number = 0

    def count(self) -> int | None:
        """Count one, and return the number of the hour if a row is due."""
        if self._clock() - self._began_s > _COUNTED_S:
            self._began_s, self._number = self._clock(), 0
        self._number += 1
        return self._number if str(self._number).rstrip("0") == "1" else None


async def reader(request: Request, bearer: Bearer) -> Actor:
    """Return the name of a caller who may read: any token, or any person who is logged in.

    Raises:
        HTTPException: 401, neither a valid token nor a log-in.
    """
    who, role = await _known(request, bearer)
    return Actor(who=who, role=role)


def changer(right: Right) -> Callable[[Request, HTTPAuthorizationCredentials | None], Awaitable[Actor]]:
    """Make a dependency for what changes something. A browser's order needs the page's token beside the cookie."""

    async def check(request: Request, bearer: Bearer) -> Actor:
        who, role = await _known(request, bearer)
        if bearer is None:
            await genuine(request)
        if right not in RIGHTS[role]:
            raise HTTPException(403, f"{who} may not do this: it asks for a token, or a person, of another role")
        return Actor(who=who, role=role)

    return check


async def _note_refused(request: Request) -> None:
    state = request.app.state
    if not hasattr(state, "refused_tokens"):
        state.refused_tokens = RefusedTokens()
    number = state.refused_tokens.count()
    if number is not None:
        address = request.client.host if request.client else "unknown"
        subject = f"from {address}, number {number} of this hour"
        await hmi_of(request).gateway.note(PersonNoted(person=_API, what="token_refused", subject=subject))


async def _known(request: Request, bearer: HTTPAuthorizationCredentials | None) -> tuple[str, Role]:
    if bearer is not None:
        token = bearer.credentials
        holder = tokens_of(request).holder(token) if len(token) <= LONGEST_TOKEN else None
        if holder is None:
            await _note_refused(request)
            raise HTTPException(
                401, "this token is not known, or has expired; make one with `station api-token add`", _CHALLENGE
            )
        return holder
    caller = caller_of(request)
    if not caller.name:
        raise HTTPException(401, "give a token, as `Authorization: Bearer TOKEN`", _CHALLENGE)
    return caller.name, caller.role
