"""User store: the people who may log in, in one file of the home folder, readable by the station's user alone."""

import json
import logging
import threading
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from pydantic import BaseModel, ConfigDict, Field

from hmi.web.roles import Role
from station.atomic_file import write_atomically
from station.errors import StationError

FOLDER = "hmi"
"""The pages' own within the home folder."""
FILE_NAME = "people.json"
MOST_PEOPLE = 200
LONGEST_PIN = 12

log = logging.getLogger(__name__)


class UserStoreError(StationError):
    """The user store cannot be read or changed; `key` is of the catalogue."""

    def __init__(self, key: str, detail: str = "") -> None:
        super().__init__(f"{key} {detail}".strip())
        self.key, self.detail = key, detail


class _Person(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    role: Role
    pin: str = Field(max_length=300)
    """An Argon2id hash in its PHC form."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    version: int = Field(1, ge=1, le=1)
    people: dict[str, _Person] = Field(default_factory=dict, max_length=MOST_PEOPLE)


def least_digits(role: Role) -> int:
    """Return the minimum length of a role's PIN."""
    return 4 if role is Role.OPERATOR else 6


def pin_problem(pin: str, role: Role) -> str:
    """Return the problem of a PIN as a key of the catalogue; empty if it is valid."""
    if not (pin.isascii() and pin.isdigit() and least_digits(role) <= len(pin) <= LONGEST_PIN):
        return "people.pin_length"
    steps = {int(after) - int(before) for before, after in pairwise(pin)}
    return "people.pin_simple" if steps in ({0}, {1}, {-1}) else ""


class UserStore:
    """Users by their names. Its methods block: `check` for some 20 ms, which slows guessing down.

    Args:
        folder: of the HMI within the home folder.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE_NAME
        # OWASP's second choice for Argon2id: 19 MiB, two passes; more would disturb the cycle beside it.
        self._hasher = PasswordHasher(time_cost=2, memory_cost=19_456, parallelism=1)
        self._unused = self._hasher.hash("000000")
        self._turn = threading.Lock()
        self.broken = ""
        """Read error of an existing file: then no log-in is possible, and it is no first start."""
        self._people = self._read()

    @property
    def first_start(self) -> bool:
        """True until the first administrator's PIN is set, here or by `station administrator`."""
        if not self._people and not self.broken:
            self._people = self._read()
        return not self._people and not self.broken

    def names(self) -> Mapping[str, Role]:
        """Return all users with their roles."""
        return {name: person.role for name, person in sorted(self._people.items())}

    def check(self, name: str, pin: str) -> Role | None:
        """Return the role of a user whose PIN is right; takes as long for an unknown name."""
        person = self._people.get(name)
        try:
            self._hasher.verify(self._unused if person is None else person.pin, pin[:100])
        except (VerificationError, InvalidHashError):
            return None
        return None if person is None else person.role

    def begin(self, name: str, pin: str) -> None:
        """Add the first user, an administrator.

        Raises:
            UserStoreError: there is a user already, or the name or the PIN is invalid.
        """
        with self._turn:
            if not self.first_start:
                raise UserStoreError("people.begun")
            self._put(name, Role.ADMIN, pin)

    def put(self, name: str, role: Role, pin: str) -> None:
        """Add a user, or change a user's role or PIN.

        Raises:
            UserStoreError: the name or the PIN is invalid, or no administrator would be left.
        """
        with self._turn:
            self._put(name, role, pin)

    def remove(self, name: str) -> None:
        """Remove a user; does nothing for an unknown name.

        Raises:
            UserStoreError: no administrator would be left.
        """
        with self._turn:
            self._write({key: each for key, each in self._people.items() if key != name})

    def _put(self, name: str, role: Role, pin: str) -> None:
        known = self._people.get(name)
        if not name.strip() or name != name.strip() or len(name) > 40 or not name.isprintable():
            raise UserStoreError("people.bad_name")
        if role is Role.VIEWER:
            raise UserStoreError("people.bad_role")
        if not pin and known is not None and least_digits(role) <= least_digits(known.role):
            person = _Person(role=role, pin=known.pin)
        elif wrong := pin_problem(pin, role):
            raise UserStoreError(wrong, str(least_digits(role)))
        else:
            person = _Person(role=role, pin=self._hasher.hash(pin))
        self._write({**self._people, name: person})

    def _write(self, people: dict[str, _Person]) -> None:
        if self.broken:
            raise UserStoreError("people.broken", self.broken)
        if not any(each.role is Role.ADMIN for each in people.values()):
            raise UserStoreError("people.last_admin")
        if len(people) > MOST_PEOPLE:
            raise UserStoreError("people.too_many")
        data = _File(version=1, people=people).model_dump_json(indent=1).encode()
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_atomically(self.path, data, 0o600)
        except OSError as error:
            raise UserStoreError("people.not_written", f"{self.path}: {error.strerror}") from error
        self._people = people

    def _read(self) -> dict[str, _Person]:
        try:
            content = json.loads(self.path.read_bytes())
            return _File.model_validate(content).people
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            self.broken = (
                f"{self.path} cannot be read: {error}; put a good copy in its place, or remove it, and start the pages "
                "again: without it the first person at the panel chooses a new administrator's PIN"
            )
            log.exception("nobody can log in")
            return {}
