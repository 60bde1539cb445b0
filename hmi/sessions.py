"""Who is logged in at which browser, and the tokens that make each order one of this page and of this moment."""

import hashlib
import hmac
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from hmi.roles import RIGHTS, Right, Role

TOKEN_LIFE_S = 12 * 3600.0
MOST_SESSIONS = 200
_MOST_USED = 20_000


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks."""

    name: str
    """Empty for a viewer who is not logged in."""
    role: Role
    session: str
    """The browser's cookie."""

    def may(self, right: Right) -> bool:
        """Whether the role has a right.

        Args:
            right: which.
        """
        return right in RIGHTS[self.role]


@dataclass(slots=True)
class _LoggedIn:
    name: str
    role: Role
    touched_s: float


class Sessions:
    """The browsers that a person is logged in at; a restart of the process logs everybody out.

    Args:
        idle_s: after this time without a touch a person is logged out.
        clock: monotonic.
    """

    def __init__(self, idle_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._idle_s, self._clock = idle_s, clock
        self._secret = secrets.token_bytes(32)
        self._sessions: OrderedDict[str, _LoggedIn] = OrderedDict()
        self._used: OrderedDict[str, float] = OrderedDict()

    @staticmethod
    def new() -> str:
        """A cookie that nobody can guess."""
        return secrets.token_urlsafe(32)

    def caller(self, session: str) -> Caller:
        """Who asks with this cookie; a viewer where nobody is logged in, or nobody any more.

        Args:
            session: the cookie.
        """
        person = self._sessions.get(session)
        if person is None or self._clock() - person.touched_s > self._idle_s:
            return Caller("", Role.VIEWER, session)
        return Caller(person.name, person.role, session)

    def touch(self, session: str) -> None:
        """A person has touched the page.

        Args:
            session: the cookie.
        """
        if self.caller(session).name:
            self._sessions[session].touched_s = self._clock()

    def log_in(self, name: str, role: Role) -> str:
        """Log a person in.

        Args:
            name: who has shown the PIN.
            role: theirs.

        Returns:
            A new cookie: one that was there before the log-in is worth nothing.
        """
        session = self.new()
        self._sessions[session] = _LoggedIn(name, role, self._clock())
        while len(self._sessions) > MOST_SESSIONS:
            self._sessions.popitem(last=False)
        return session

    def log_out(self, session: str) -> None:
        """Log out; nothing happens where nobody was logged in.

        Args:
            session: the cookie.
        """
        self._sessions.pop(session, None)

    def forget(self, name: str) -> None:
        """Log a person out everywhere, as when the role or the PIN is another one now.

        Args:
            name: whose.
        """
        self._sessions = OrderedDict((key, each) for key, each in self._sessions.items() if each.name != name)

    def sweep(self) -> list[Caller]:
        """Forget those who were idle for too long.

        Returns:
            Who they were.
        """
        now_s = self._clock()
        idle = [key for key, each in self._sessions.items() if now_s - each.touched_s > self._idle_s]
        return [Caller(each.name, each.role, key) for key in idle if (each := self._sessions.pop(key))]

    def token(self, session: str) -> str:
        """A token for one order from a page of this browser.

        Args:
            session: the cookie.
        """
        body = f"{int(self._clock())}.{secrets.token_urlsafe(12)}"
        return f"{body}.{self._mac(session, body)}"

    def spend(self, session: str, token: str) -> str:
        """Use a token up.

        Args:
            session: the cookie that came with it.
            token: as it came.

        Returns:
            What is wrong with it, as a key of the catalogue: `problem.forged`, `problem.replayed` or `problem.old`;
            empty where it was good.
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
