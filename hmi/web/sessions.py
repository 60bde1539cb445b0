"""Sessions: the person logged in at each browser, and one-time tokens for orders."""

import hashlib
import hmac
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from hmi.web.roles import RIGHTS, Right, Role

TOKEN_LIFE_S = 12 * 3600.0
MOST_SESSIONS = 200
_MOST_USED = 20_000


@dataclass(frozen=True, slots=True)
class Caller:
    """The author of a request."""

    name: str
    """Empty for a viewer who is not logged in."""
    role: Role
    session: str
    """The browser's cookie."""

    def may(self, right: Right) -> bool:
        """Return whether the role has a right."""
        return right in RIGHTS[self.role]


@dataclass(slots=True)
class _LoggedIn:
    name: str
    role: Role
    touched_s: float


class Sessions:
    """Log-ins by browser, ended after `idle_s` without a touch; a restart of the process logs everybody out."""

    def __init__(self, idle_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._idle_s, self._clock = idle_s, clock
        self._secret = secrets.token_bytes(32)
        self._sessions: OrderedDict[str, _LoggedIn] = OrderedDict()
        self._used: OrderedDict[str, float] = OrderedDict()

    @staticmethod
    def new() -> str:
        """Make a random cookie."""
        return secrets.token_urlsafe(32)

    def caller(self, session: str) -> Caller:
        """Return the caller with this cookie; a viewer if nobody is logged in or the session has expired."""
        person = self._sessions.get(session)
        if person is None or self._clock() - person.touched_s > self._idle_s:
            return Caller("", Role.VIEWER, session)
        return Caller(person.name, person.role, session)

    def touch(self, session: str) -> None:
        """Restart the session's idle time."""
        if self.caller(session).name:
            self._sessions[session].touched_s = self._clock()

    def log_in(self, name: str, role: Role) -> str:
        """Log a person in, and return a new cookie; the one from before the log-in is not valid for this session."""
        session = self.new()
        self._sessions[session] = _LoggedIn(name, role, self._clock())
        while len(self._sessions) > MOST_SESSIONS:
            self._sessions.popitem(last=False)
        return session

    def log_out(self, session: str) -> None:
        """Log out. Idempotent."""
        self._sessions.pop(session, None)

    def forget(self, name: str) -> None:
        """Log a person out everywhere, as after a change of role or PIN."""
        self._sessions = OrderedDict((key, each) for key, each in self._sessions.items() if each.name != name)

    def sweep(self) -> list[Caller]:
        """Remove expired sessions, and return their callers."""
        now_s = self._clock()
        idle = [key for key, each in self._sessions.items() if now_s - each.touched_s > self._idle_s]
        return [Caller(each.name, each.role, key) for key in idle if (each := self._sessions.pop(key))]

    def token(self, session: str) -> str:
        """Make a token for one order from a page of this browser."""
        body = f"{int(self._clock())}.{secrets.token_urlsafe(12)}"
        return f"{body}.{self._mac(session, body)}"

    def spend(self, session: str, token: str) -> str:
        """Check and invalidate a token.

        Args:
            session: the cookie of the request.
            token: the token of the request.

        Returns:
            The problem as a key of the catalogue: `problem.forged`, `problem.replayed` or `problem.old`; empty if the
            token is valid.
        """
        body, _, mac = token.rpartition(".")
        issued = body.partition(".")[0]
        if not hmac.compare_digest(mac.encode(), self._mac(session, body).encode()) or not issued.isdigit():
            return "problem.forged"
        if self._clock() - int(issued) > TOKEN_LIFE_S:
            return "problem.old"
        if body in self._used:
            return "problem.replayed"
        self._used[body] = self._clock()
        while len(self._used) > _MOST_USED:
            self._used.popitem(last=False)
        return ""

    def _mac(self, session: str, body: str) -> str:
        return hmac.new(self._secret, f"{session}\n{body}".encode(), hashlib.sha256).hexdigest()
