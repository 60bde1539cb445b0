"""API token store: the tokens of a plant's systems, as hashes only."""

import hashlib
import hmac
import json
import math
import secrets
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from hmi.web.roles import Role
from station.atomic_file import write_atomically
from station.clock import utc_ms
from station.errors import BadInputError, StationError

FILE_NAME = "api_tokens.json"
PREFIX = "fst_"
MOST_TOKENS = 100
NAME = r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,39}$"
ROLES = (Role.VIEWER, Role.OPERATOR)
"""A viewer's token reads; an operator's also begins and ends lots."""
_DAY_MS = 86_400_000
_COUNTED_S = 3600.0
"""Period after which the count of refused tokens begins anew: the hour of its rows in the audit trail."""


class Token(BaseModel):
    """One token's stored data."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    role: Role
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    """Of the token; it has 256 bits of chance, so that a plain hash is as good as a slow one."""
    made_utc_ms: int
    expires_utc_ms: int | None = None
    """None for a token that is valid until it is removed."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    version: int = Field(1, ge=1, le=1)
    tokens: dict[str, Token] = Field(default_factory=dict, max_length=MOST_TOKENS)


class ApiTokens:
    """Tokens of one station, in the HMI's folder; a change by the command line takes effect at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE_NAME
        self._seen: object = None
        self._tokens: dict[str, Token] = {}

    def all(self) -> Mapping[str, Token]:
        """Return the tokens by their names.

        Raises:
            StationError: the file cannot be read.
        """
        self._refresh()
        return self._tokens

    def holder(self, token: str) -> tuple[str, Role] | None:
        """Return the owner of a token and its role; None if it is unknown or expired, or the file cannot be read."""
        sha256 = hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()
        try:
            self._refresh()
        except StationError:
            return None
        found = [(name, each) for name, each in self._tokens.items() if hmac.compare_digest(each.sha256, sha256)]
        valid = [(name, each.role) for name, each in found if (each.expires_utc_ms or math.inf) > utc_ms()]
        return valid[0] if valid else None

    def add(self, name: str, role: Role, days: int | None = None) -> str:
        """Create a token and return it; it cannot be read again.

        Args:
            name: the owner, for the audit trail.
            days: how long it is valid; None until it is removed.

        Raises:
            BadInputError: the name is in use.
            StationError: the file cannot be written.
        """
        self._refresh()
        if name in self._tokens:
            raise BadInputError(f"there is a token {name!r} already; remove it first, or give another name")
        if len(self._tokens) >= MOST_TOKENS:
            raise BadInputError(f"there are {MOST_TOKENS} tokens already; remove one first")
        token = PREFIX + secrets.token_urlsafe(32)
        sha256 = hashlib.sha256(token.encode()).hexdigest()
        now_ms = utc_ms()
        expires_ms = None if days is None else now_ms + days * _DAY_MS
        made = Token(role=role, sha256=sha256, made_utc_ms=now_ms, expires_utc_ms=expires_ms)
        self._write({**self._tokens, name: made})
        return token

    def remove(self, name: str) -> None:
        """Withdraw a token.

        Raises:
            BadInputError: there is no token of that name.
            StationError: the file cannot be written.
        """
        self._refresh()
        if name not in self._tokens:
            known = ", ".join(self._tokens) or "none"
            raise BadInputError(f"there is no token {name!r}; there are: {known}")
        self._write({key: each for key, each in self._tokens.items() if key != name})

    def _refresh(self) -> None:
        try:
            stat = self._path.stat()
            seen = (stat.st_mtime_ns, stat.st_ino, stat.st_size)
            if seen != self._seen:
                self._tokens = _File.model_validate(json.loads(self._path.read_bytes())).tokens
                self._seen = seen
        except FileNotFoundError:
            self._tokens, self._seen = {}, None
        except (OSError, ValueError) as error:
            self._tokens, self._seen = {}, None
            raise StationError(f"{self._path} cannot be read: {error}; put a good copy in its place") from error

    def _write(self, tokens: dict[str, Token]) -> None:
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            data = _File(version=1, tokens=tokens).model_dump_json(indent=1, exclude_none=True)
            write_atomically(self._path, data.encode(), 0o600)
        except OSError as error:
            raise StationError(f"{self._path} cannot be written: {error.strerror}; make its folder writable") from error
        self._tokens, self._seen = tokens, None


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
